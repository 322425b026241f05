"""`impactd demo`: the main job in one go, on the simulated rig, through the real daemon.

::

    run -> rig_process   settings for the simulated rig; `impactd serve` as a process of its own
        -> drops         calibration and campaign over HTTP, shown as they happen
        -> diagnosis     the daemon's diagnosis of all drops; its model made the active one
        -> outcome       the models HSD, KV, closed KV and what was found, beside the unsealed truth
           judgement     whether the verdict was right
        -> terminal      what is printed
        -> figures       trace.png, moduli.png
        -> report        report.html (its form: page; its numbers: words), beside diagnosis.html

The hidden effect acts from the first drop on, as it would on a real rig, so the calibration is
biased by it too and nobody can tell. The diagnosis does not rest on that calibration: it starts
from the maker's certificate, and the reference drops are part of the campaign that it explains. So
cell, effect and moduli come out of one fit, and the reference materials hold the scale.

Nothing here fits or measures: the numbers are the daemon's. Only the curves drawn through the
example trace are fitted again, because the API returns parameters and not curves.
"""

from impactd.demo.run import run_demo

__all__ = ["run_demo"]
