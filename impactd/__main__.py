"""``python -m impactd`` is ``impactd``."""

from impactd.cli import main

if __name__ == "__main__":
    main()
