"""How the page looks."""

STYLE = """
:root { --ink: #202124; --soft: #5f6570; --line: #e4e6ea; --before: #c4572c; --after: #1c6dd0; }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); margin: 0 auto; max-width: 62rem;
       padding: 2rem 1rem 4rem; }
h1 { font-size: 1.5rem; margin: 0; }
h2 { font-size: 1.15rem; margin: 2.4rem 0 .6rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
.soft, figcaption, li { color: var(--soft); }
.verdict { font-size: 1.15rem; border-left: 4px solid var(--after); padding: .4rem 0 .4rem .8rem; }
.verdict b { text-transform: uppercase; font-size: .85rem; letter-spacing: .06em;
             margin-right: .4rem; }
.verdict.unknown, .verdict.partial, .verdict.family, .verdict.not_identifiable {
  border-color: var(--before); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .35rem .6rem; border-bottom: 1px solid var(--line); }
th:first-child, td:first-child { text-align: left; }
td { white-space: nowrap; }
td.words { text-align: left; white-space: normal; color: var(--soft); font-size: .9rem; }
th { font-weight: 600; color: var(--soft); font-size: .88rem; white-space: nowrap; }
th.words { text-align: left; }
tr.taken td { font-weight: 600; color: var(--after); }
.bar { display: inline-block; height: .7rem; background: var(--before); vertical-align: middle; }
figure { margin: 1rem 0; } img { width: 100%; height: auto; }
.figures { display: flex; flex-wrap: wrap; gap: 1rem; margin: 1.2rem 0; }
.figures div { flex: 1 1 12rem; border: 1px solid var(--line); border-radius: .4rem;
               padding: .6rem .9rem; }
.figures b { display: block; font-size: 1.15rem; font-variant-numeric: tabular-nums; }
.figures span { color: var(--soft); font-size: .88rem; }
.formula { font-family: ui-monospace, monospace; background: #f6f7f9; padding: .6rem .8rem;
           overflow-x: auto; }
details { margin: .6rem 0; } summary { color: var(--soft); cursor: pointer; }
figcaption { font-size: .9rem; }
ul { padding-left: 1.2rem; }
code { font-size: .92em; }
td.group { text-align: left; font-weight: 600; color: var(--soft); border-bottom: 0;
           padding-top: .9rem; }
.budget table { font-size: .84rem; }
.budget th, .budget td { padding: .3rem .4rem; }
.budget th, .budget td.input { white-space: normal; }
.verdict.fail, .verdict.undecided { border-color: var(--before); }
@media print {
  body { max-width: none; font-size: 11px; padding: 0; }
  table, figure, .verdict, .figures { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
  .wide { overflow: visible; }
  td, th { padding: .2rem .35rem; }
  td, th, td.words { white-space: normal; }
  details::details-content { content-visibility: visible; height: auto; }
  @page { size: A4 landscape; margin: 14mm; }
}
"""
