//! The style of a report.

use crate::plot::svg::Ink;

/// Colours of the pictures as variables, light and dark, and the style that rests on them.
pub(super) fn css() -> String {
    let colours = |of: fn(Ink) -> &'static str| Ink::ALL.map(|ink| format!("--{}:{};", ink.name(), of(ink))).concat();
    let (light, dark) = (colours(Ink::light), colours(Ink::dark));
    format!(
        ":root{{color-scheme:light dark;{light}--good:#1a7f37;--bad:#bc4c00;--unsure:#6e5494;--raised:#f6f8fa}}\
         @media(prefers-color-scheme:dark){{:root{{{dark}--good:#3fb950;--bad:#ff8c42;--unsure:#b392f0;--raised:#161b22}}}}{STYLE}"
    )
}

// The second column of the evidence is why an effect was not taken, the fifth its size, of up to three numbers: these are worth a second line.
const STYLE: &str = "\
*{box-sizing:border-box}\
html{-webkit-text-size-adjust:100%}\
body{margin:0;background:var(--paper);color:var(--text);font:16px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,'Noto Sans',sans-serif}\
header,main,footer{max-width:56rem;margin:0 auto;padding:0 1rem}\
header{padding-top:1.5rem}\
h1{font-size:1.7rem;line-height:1.2;margin:0 0 .8rem;overflow-wrap:anywhere}\
h2{font-size:1.25rem;margin:0 0 .7rem;line-height:1.3}\
h3{font-size:1rem;margin:1.2rem 0 .4rem}\
section{margin:2.2rem 0}\
.facts{display:flex;flex-wrap:wrap;gap:.4rem 2.2rem;margin:0}\
.facts dt{color:var(--muted);font-size:.8rem}\
.facts dd{margin:0;overflow-wrap:anywhere}\
.log{display:inline-block;margin-right:1.2em}\
small{color:var(--muted)}\
.verdict{border-left:.35rem solid var(--tone);background:var(--raised);padding:1rem 1.2rem;border-radius:.3rem;margin:1.4rem 0}\
.good{--tone:var(--good)}.bad{--tone:var(--bad)}.unsure{--tone:var(--unsure)}\
.verdict h2{margin:0}.verdict ul{margin:.6rem 0 0;padding-left:1.2rem}.verdict li{margin:.25rem 0}\
.experiment{margin:.7rem 0 0}\
.sign{color:var(--tone);font-weight:bold}\
nav{display:flex;flex-wrap:wrap;gap:.3rem 1.1rem;font-size:.92rem}\
a{color:var(--residual)}\
.scroll{overflow-x:auto;margin:.6rem min(0px,28rem - 50vw + 1rem) .6rem 0}\
table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}\
caption{text-align:left;color:var(--muted);font-size:.85rem;padding-bottom:.4rem}\
th,td{padding:.3rem .8rem .3rem 0;text-align:left;white-space:nowrap;border-bottom:1px solid var(--grid);vertical-align:top}\
thead th{color:var(--muted);font-weight:600}\
tbody th{font-weight:600}\
.n{text-align:right}\
#evidence thead th,#evidence td:nth-child(2),#evidence td:nth-child(5){white-space:normal}#evidence td:nth-child(2){min-width:7rem}#evidence td:nth-child(5){min-width:11rem}\
figure{margin:0 0 1.4rem}\
figcaption{color:var(--muted);font-size:.85rem}\
svg{display:block;width:100%;height:auto;font-family:inherit}\
.narrow{display:none}\
@media(max-width:40rem){.wide{display:none}.narrow{display:block}h1{font-size:1.4rem}}\
p.note{color:var(--muted);font-size:.9rem;margin:.4rem 0}\
footer{color:var(--muted);font-size:.85rem;padding-bottom:2rem}\
@media print{nav{display:none}section{break-inside:avoid}.scroll{overflow:visible;margin-right:0}\
table{font-size:.7rem}th,td{white-space:normal;padding-right:.4rem}}";
