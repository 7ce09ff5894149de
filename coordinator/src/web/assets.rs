//! The page's own files, in the program itself: no build step, nothing is loaded from elsewhere.

/// The page.
const HTML: &str = include_str!("assets/index.html");
/// Why nothing can be changed from a page.
const UNCHANGEABLE: &str = "Nothing can be changed from here: no token is configured (web.token)";
/// The page's icon.
pub(super) const ICON: &str = include_str!("assets/icon.svg");
/// All style sheets.
pub(super) const CSS: &str = concat!(include_str!("assets/uplot/uPlot.min.css"), "\n", include_str!("assets/style.css"));
/// All scripts: the chart library, then ours.
pub(super) const JS: &str = concat!(
    include_str!("assets/uplot/uPlot.iife.min.js"),
    "\n",
    include_str!("assets/dom.js"),
    include_str!("assets/charts.js"),
    include_str!("assets/fleet.js"),
    include_str!("assets/stations.js"),
    include_str!("assets/plan.js"),
    include_str!("assets/panels.js"),
    include_str!("assets/detail.js"),
    include_str!("assets/report.js"),
    include_str!("assets/main.js"),
);

/// The page that lives on its server. Where no token is configured it says so, in place of asking for one.
pub(super) fn live_page(has_token: bool) -> String {
    let page = page("icon.svg", "<link rel=\"stylesheet\" href=\"style.css\">", "<script src=\"script.js\" defer></script>", "");
    if has_token { page } else { page.replace("<body>", &format!("<body data-unchangeable=\"{UNCHANGEABLE}\">")) }
}

/// The page as one file that holds all it shows.
pub(super) fn whole_page(data: &str) -> String {
    // Inside a script element only the text that would end it must be hidden.
    let data = data.replace("</", "<\\/").replace("<!--", "<\\u0021--");
    let icon = format!("data:image/svg+xml,{}", ICON.trim().replace('%', "%25").replace('#', "%23").replace('"', "'"));
    page(
        &icon,
        &format!("<style>\n{CSS}\n</style>"),
        &format!("<script>\n{JS}\n</script>"),
        &format!("<script type=\"application/json\" id=\"data\">{data}</script>"),
    )
}

fn page(icon: &str, style: &str, script: &str, data: &str) -> String {
    let icon = format!("<link rel=\"icon\" href=\"{icon}\">");
    HTML.replace("<!-- icon -->", &icon).replace("<!-- style -->", style).replace("<!-- data -->", data).replace("<!-- script -->", script)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_can_change_nothing_says_so() {
        assert!(live_page(false).contains(UNCHANGEABLE));
        assert!(!live_page(true).contains(UNCHANGEABLE) && live_page(true).contains("<body>"));
    }
}
