"""What a person sees on a terminal and what a pipe gets, told apart by a real terminal."""

from __future__ import annotations

import os
import pty
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from impactd.cli import app
from impactd.console.calibrations import next_drop
from impactd.console.options import JsonCommand
from impactd.console.tables import WIDTH, table

STEPS = (
    "from impactd.console.progress_bar import progress, progress_by_step\n"
    "tell = progress_by_step()\n"
    "for at, what in enumerate(('A (1 of 2): x', 'A (1 of 2): y', 'B (2 of 2): z')):\n"
    "    tell(what, at / 3)\n"
    "progress('', last=True)\nprint('done')"
)
COLOUR = "\x1b["
BAR = (
    "import time\nfrom impactd.console.progress_bar import progress\n"
    "for done in range(4): progress('fitting', share=done / 4); time.sleep(0.15)\n"
    "progress('', last=True)\nprint('done')"
)


def on_a_terminal(*words: str, **environment: str) -> str:
    """Return what a command writes to a terminal."""
    ours, theirs = pty.openpty()
    clean = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "TERM")}
    process = subprocess.Popen(
        words, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True,
        env={**clean, "TERM": "xterm", **environment},
    )  # fmt: skip
    os.close(theirs)
    seen = b""
    try:
        while chunk := os.read(ours, 4096):
            seen += chunk
    except OSError:  # the other end is closed
        pass
    os.close(ours)
    process.wait(timeout=60)
    return seen.decode()


def test_colours_are_for_terminals_that_want_them():
    """A bad finding is red on a terminal, plain with NO_COLOR, on a dumb one, and in a pipe."""
    words = [sys.executable, "-m", "impactd", "doctor", "--config", "/none.toml"]
    assert f"{COLOUR}31m" in on_a_terminal(*words)
    assert COLOUR not in on_a_terminal(*words, NO_COLOR="1")
    assert COLOUR not in on_a_terminal(*words, TERM="dumb")
    piped = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert COLOUR not in piped.stdout + piped.stderr
    assert "BAD  configuration" in piped.stdout


def test_a_bar_is_for_terminals_and_leaves_no_trace():
    """It tells what and how far; a pipe sees nothing of it."""
    seen = on_a_terminal(sys.executable, "-c", BAR)
    assert "fitting" in seen
    assert "75%" in seen
    assert seen.rstrip().endswith("done")
    words = [sys.executable, "-c", BAR]
    piped = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert (piped.stdout, piped.stderr) == ("done\n", "")


def test_long_work_tells_its_steps_to_a_log():
    """One line where a step begins, on standard error; on a terminal it is the bar."""
    words = [sys.executable, "-c", STEPS]
    piped = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert piped.stdout == "done\n"
    assert piped.stderr.splitlines() == ["A (1 of 2): x", "B (2 of 2): z"]
    assert "A (1 of 2): x" in on_a_terminal(*words)


def test_every_command_speaks_json():
    """Each command has --json and needs no file for it, those that only group others excepted."""
    for command in (
        *app.registered_commands,
        *app.registered_groups[0].typer_instance.registered_commands,
    ):
        assert command.callback is not None
        parameters = command.callback.__annotations__
        assert {"as_json", "json_out"} & set(parameters), command.callback.__name__
        prints = command.cls is JsonCommand or "as_json" in parameters
        assert prints, f"{command.callback.__name__} --json needs a file"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_completes_commands(shell):
    """The script that each shell loads is written, and the program answers what it asks."""
    script = subprocess.run(
        [sys.executable, "-m", "impactd"], capture_output=True, text=True, check=False, timeout=60,
        env={**os.environ, "_IMPACTD_COMPLETE": f"source_{shell}"},
    ).stdout  # fmt: skip
    assert "_IMPACTD_COMPLETE" in script
    asked = {"bash": {"COMP_WORDS": "impactd cal", "COMP_CWORD": "1"}}.get(
        shell, {"_TYPER_COMPLETE_ARGS": "impactd cal", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    )
    found = subprocess.run(
        [sys.executable, "-m", "impactd"], capture_output=True, text=True, check=False, timeout=60,
        env={**os.environ, "_IMPACTD_COMPLETE": f"complete_{shell}", **asked},
    ).stdout  # fmt: skip
    assert "calibrate" in found
    assert "shots" not in found


def test_a_shell_completes_what_hangs_in_the_drawer(tmp_path: Path):
    """Spheres and surfaces come from the materials file; a broken one disturbs nobody."""
    assert complete("impactd drop ac", 2).split() == ["acetal", "acetal_small"]
    assert complete("impactd drop acetal spec", 3).split() == ["specimen"]
    broken = tmp_path / "rig.toml"
    broken.write_text("[materials\n")
    assert complete("impactd drop ac", 2, IMPACTD_CONFIG=str(broken)).split() == []


def complete(words: str, place: int, **environment: str) -> str:
    """Return what bash would be offered for a line."""
    asked = {"_IMPACTD_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(place)}
    made = subprocess.run(
        [sys.executable, "-m", "impactd"], capture_output=True, text=True, check=False, timeout=60,
        env={**os.environ, **asked, **environment},
    )  # fmt: skip
    assert made.stderr == ""
    return made.stdout


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_itself_completes(tmp_path: Path):
    """A real bash loads the script and completes the word that was begun."""
    script = tmp_path / "impactd.bash"
    command = f"{Path(sys.executable).parent / 'impactd'}"
    script.write_text(
        f'export PATH="{Path(command).parent}:$PATH"\n'
        'eval "$(_IMPACTD_COMPLETE=source_bash impactd)"\n'
        "COMP_WORDS=(impactd exp); COMP_CWORD=1; _impactd_completion impactd exp impactd\n"
        'echo "${COMPREPLY[@]}"\n'
    )
    made = subprocess.run(
        ["bash", str(script)], capture_output=True, text=True, check=False, timeout=60
    )
    assert made.stdout.strip() == "export", made.stderr


def test_a_shell_completes_models_and_effects():
    """Bases, effects after a plus, and what the demo may hide."""
    assert complete("impactd fit x.json --model k", 4).split() == ["kv", "kv2"]
    assert "kv2+finite_thickness" in complete("impactd fit x.json --model kv2+finite", 4)
    assert complete("impactd demo --effect ran", 3).split() == ["random"]
    assert complete("impactd plot 9 --kind tra", 4).split() == ["trace", "traces"]


def test_no_table_is_wider_than_its_place():
    """Long columns are wrapped under themselves, and no word of them is lost."""
    words = "it seems to be something of the contact that nobody has named until now " * 3
    lines = table(("a", "note"), [("one", words), ("two", "short")]).splitlines()
    assert max(len(line) for line in lines) <= WIDTH
    assert lines[3].startswith("   ")
    assert " ".join(line[5:].strip() for line in lines[2:-1]).split() == words.split()
    both = table(("a", "b", "c"), [(words[:70], "a_word_that_is_not_broken", words)]).splitlines()
    assert max(len(line) for line in both) <= WIDTH
    assert sorted(" ".join(both[2:]).split()) == sorted(
        f"{words[:70]} a_word_that_is_not_broken {words}".split()
    )


def test_the_table_of_effects_fits_its_place():
    """The widest of all: five columns, three of them sentences."""
    words = [sys.executable, "-m", "impactd", "effects"]
    said = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout
    assert max(map(len, said.splitlines())) <= WIDTH


def test_a_calibration_says_which_sphere_to_hang():
    """As how many of how many, and how long the rest takes."""
    wanted = {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.025}
    said = next_drop({"done": 2, "of": 8, "remaining_s": 31.2, "next": wanted})
    assert said == (
        "Drop 3 of 8: hang the acetal sphere 25.0 mm above the aluminium coupon (about 31 s left)."
    )
