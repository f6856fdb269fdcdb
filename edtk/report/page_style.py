"""How a page looks: on a desk, on a phone, in the dark and on paper."""

# The shadows at the edges of a box that scrolls are the cue that there is more: two covers in the
# colour of the page move with the content and hide them where there is none.
PAGE_STYLE = """
:root { color-scheme: light dark; --page: #fff; --ink: #1b1b1b; --line: #8886; --shade: #0007;
  --good: #00795c; --usable: #b35900; --bad: #b3261e; --blue: #0072b2; }
@media (prefers-color-scheme: dark) { :root { --page: #17191c; --ink: #e8e8e8; --shade: #fff9;
  --good: #3fbf98; --usable: #f0983e; --bad: #f2766d; --blue: #4ba6dd; } }
* { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 80rem; margin: 0 auto; padding: 1rem;
  background: var(--page); color: var(--ink); overflow-wrap: break-word; }
h1 { font-size: 1.5rem; line-height: 1.25; } h2 { font-size: 1.2rem; margin: 1.5rem 0 0; }
h3 { font-size: 1rem; margin: .5rem 0; }
.verdict { border-left: .4rem solid; border-radius: .3rem; padding: .6rem 1rem; background: #8881; }
.verdict p { margin: .3rem 0; }
.verdict p:first-child { font-size: 1.15rem; font-weight: 600; }
.good { border-color: var(--good); }
.usable { border-color: var(--usable); }
.bad { border-color: var(--bad); }
section { display: grid; gap: .75rem 1.5rem; align-items: start;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr)); }
section > * { min-width: 0; margin-bottom: 0; }
h2, section > p, .full { grid-column: 1 / -1; }
section > p { margin: 0; }
p { max-width: 60rem; }
.number { white-space: nowrap; }
.box { overflow-x: auto; background:
  linear-gradient(to right, var(--page) 60%, transparent) left / 1.5rem 100% no-repeat local,
  linear-gradient(to left, var(--page) 60%, transparent) right / 1.5rem 100% no-repeat local,
  linear-gradient(to right, var(--shade), transparent) left / .7rem 100% no-repeat scroll,
  linear-gradient(to left, var(--shade), transparent) right / .7rem 100% no-repeat scroll; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .5rem; border-bottom: 1px solid var(--line); vertical-align: top; }
th, td { text-align: right; white-space: nowrap; }
th { vertical-align: bottom; white-space: normal; }
th:first-child, td:first-child, .words { text-align: left; }
td.words { white-space: normal; min-width: 11rem; }
dl { display: grid; grid-template-columns: minmax(6rem, auto) 1fr; gap: .25rem 1rem; margin: 0; }
dt { opacity: .8; } dd { margin: 0; min-width: 0; overflow-wrap: anywhere; }
figure { margin: 0; }
svg { display: block; width: 100%; height: auto; }
svg text { fill: currentColor; }
figcaption { font-size: .9rem; opacity: .8; }
@media print {
  :root { color-scheme: light; --page: #fff; --ink: #000; --good: #00795c; --usable: #b35900;
    --bad: #b3261e; --blue: #0072b2; }
  body { font-size: 10pt; padding: 0; max-width: none; }
  section { display: block; }
  section > * { margin-top: .5rem; }
  figure, .verdict, .box, p, tr, dl { break-inside: avoid; }
  h2, h3, section > p { break-after: avoid; }
  .box { overflow: visible; background: none; }
  th, td { white-space: normal; padding: .15rem .4rem; font-size: 8.5pt; }
  svg { min-width: 0 !important; max-width: 11cm !important; max-height: 22cm; }
  .full svg { max-width: 17cm !important; }
}
"""
