"""`impactd demo`: the main job in one go, on the simulated rig, through the real daemon.

::

    run -> rig_process   settings for the simulated rig; `impactd serve` as a process of its own
        -> drops         calibration and campaign over HTTP, shown as they happen
        -> outcome       the daemon's fits laid beside the unsealed truth
        -> figures       trace.png, moduli.png
        -> report        report.html, complete in one file

Nothing here fits or measures: the numbers are the daemon's. Only the curves drawn through the
example trace are fitted again, because the API returns parameters and not curves.
"""

from impactd.demo.run import run_demo

__all__ = ["run_demo"]
