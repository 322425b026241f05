"""The form of report.html."""

from string import Template

PAGE = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>impactd demo</title>
<style>
  :root { --ink: #202124; --soft: #5f6570; --line: #e4e6ea; --kv: #1c6dd0; --hsd: #b5651d;
          --after: #1b8a5a; }
  body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); margin: 0 auto; max-width: 66rem;
         padding: 2rem 1rem 4rem; }
  h1 { font-size: 1.5rem; margin: 0; }
  h2 { font-size: 1.1rem; margin: 2.2rem 0 .6rem; }
  p, .soft { color: var(--soft); }
  .verdict { color: var(--ink); font-size: 1.15rem; border-left: 4px solid var(--kv);
             padding: .3rem 0 .3rem .8rem; }
  .verdict.right { border-color: var(--after); } .verdict.wrong { border-color: var(--hsd); }
  .verdict b { font-size: .85rem; letter-spacing: .06em; margin-right: .3rem; }
  .wide { overflow-x: auto; }
  table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
  th, td { text-align: right; padding: .35rem .6rem; border-bottom: 1px solid var(--line); }
  td { white-space: nowrap; }
  th:first-child, td:first-child { text-align: left; }
  th { font-weight: 600; color: var(--soft); font-size: .88rem; vertical-align: bottom; }
  .hsd, th.hsd { color: var(--hsd); } .kv, th.kv { color: var(--kv); }
  .after, th.after { color: var(--after); } tr.after { font-weight: 600; }
  figure { margin: 1rem 0; } img { max-width: 100%; height: auto; }
  figcaption { color: var(--soft); font-size: .9rem; }
  ul { padding-left: 1.2rem; color: var(--soft); }
</style>
</head>
<body>
<h1>From a drop to a modulus, and to what the model lacked</h1>
<p>One run of <code>impactd demo</code>: $drops drops on the simulated rig (seed $seed) through
HTTP, the USB protocol and a serial line, as on a real one. The truth was sealed until the daemon
had given its last verdict.</p>
<p class="verdict"><b>$verdict</b> $sentence</p>

<h2>The models</h2>
<p>The same drops were fitted with one model after the other. HSD assumes a rigid load cell. In KV
its crystal moves (both Maranzano &amp; Hancock 2016). The closed KV adds the missing mechanics: the
dashpot pushes the crystal too, the coupon's mass rides on it, nothing pulls at lift-off, the sphere
falls through air. The last model adds what explains the residual of the closed KV. The noise before
the trigger is $noise mV: no model can be better. A fit that looks good can still give a wrong
modulus: compare the error with the modulus.</p>
<div class="wide">$ladder</div>
<p class="soft">$active</p>

<h2>What the simulated rig had sealed</h2>
<ul>$sealed</ul>
<p class="verdict $mark"><b>$word</b> $judgement</p>

<h2>What was seen in the residual of the closed KV</h2>
<ul>$seen</ul>
<p><a href="diagnosis.html">The report of the diagnosis</a> has all of it, with the candidates and
the reasons why they were rejected.</p>
<figure><img alt="A trace with HSD and the closed KV, and the residual of each" src="$trace_png">
<figcaption>The residual of a model shows what it lacks. HSD cannot ring as the crystal does. At
the bottom, on its own scale: the residual of the closed KV for this sphere, coupon and height,
mean over the repetitions, and the residual of the last model.</figcaption></figure>

<h2>Reduced modulus E* of each pair / GPa</h2>
<p>A drop measures E* of a pair, not the modulus of either material.
± is the expanded uncertainty U (95 %). All pairs share the error of
one load cell: they are inside or outside together more often than not.</p>
<div class="wide">$pairs</div>

<h2>Young's modulus of each material / GPa</h2>
<p>From the network of all pairs and the stated moduli. A normal impact does not determine Poisson's
ratio; its uncertainty is included.</p>
<div class="wide">$materials</div>

<figure><img alt="Deviation of each modulus from the truth, with 95 % intervals" src="$moduli_png">
</figure>

<h2>The load cell</h2>
<p>The effect acted during calibration $calibration too, so the error of that calibration may exceed
its stated uncertainty. The diagnosis therefore starts from the maker's certificate and uses the
$calibration_drops drops of the reference spheres like any others: one fit gives cell, effect and
moduli. The identifiable combinations come first; mass, stiffness and damping alone stay
uncertain.</p>
<div class="wide">$sensor</div>

<p class="soft">$software. Beside this file: <code>diagnosis.html</code> and
<code>diagnosis.json</code>, <code>moduli.json</code>, the shots as a campaign folder
(<code>shots/campaign.json</code>) and the archive with the original HDF5 files
(<code>archive/shots</code>).</p>
</body>
</html>
""")
