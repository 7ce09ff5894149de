// The page as a report: what runs of a scenario came to, from the file itself.

function showReport(report) {
  document.documentElement.classList.add("is-report");
  document.title = `${report.title} – Tender`;
  setText(byId("status-text"), `simulated, seed ${report.seed}, Tender ${report.version}`);
  setClass(byId("status"), "status quiet");
  renderOutcome(report);
  const buttons = report.runs.map((run, n) => h("button", { type: "button", "aria-pressed": "false", onclick: () => showRun(report, n) }, run.name));
  byId("runs").replaceChildren(...buttons);
  byId("runs").hidden = report.runs.length < 2;
  listenToFleetForm((find, sort) => { report.find = find; report.sort = sort; showRun(report, report.shown); });
  showRun(report, report.runs.length - 1);
}

/** What was measured in runs, beside what was expected; nothing of runs that go on. */
function renderOutcome(ended) {
  const text = JSON.stringify(ended?.runs.map((run) => [run.name, run.metrics]) ?? null);
  if (renderOutcome.shown === text) return;
  renderOutcome.shown = text;
  byId("outcome").hidden = !ended;
  if (!ended) return;
  const { note, runs } = ended;
  setText(byId("outcome-note"), note);
  const all = [...new Set(runs.flatMap((run) => run.metrics.map((row) => row.metric)))];
  const judged = all.filter((name) => runs.some((run) => run.metrics.some((row) => row.metric === name && row.holds != null)));
  const cell = (run, name) => {
    const row = run.metrics.find((metric) => metric.metric === name);
    const mark = row?.holds == null ? null : h("span", { class: row.holds ? "tone good" : "tone bad" }, row.holds ? "as expected" : `expected ${row.expected}`);
    return h("td", { class: "num" }, row?.text ?? "–", " ", mark);
  };
  const table = (names) => h("table", {},
    h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Measured"), ...runs.map((run) => h("th", { scope: "col" }, run.name)))),
    h("tbody", {}, ...names.map((name) => h("tr", {}, h("th", { scope: "row" }, name.replaceAll("_", " ")), ...runs.map((run) => cell(run, name))))));
  const rest = all.filter((name) => !judged.includes(name));
  const more = judged.length === 0 ? table(all) : h("details", {}, h("summary", {}, `${rest.length} more that were measured`), table(rest));
  byId("outcome-body").replaceChildren(...(judged.length ? [table(judged)] : []), more);
}

function showRun(report, n) {
  const run = report.runs[n];
  if (report.shown !== n) { plan.window = null; announce.last = undefined; }
  report.shown = n;
  [...byId("runs").children].forEach((button, index) => button.setAttribute("aria-pressed", String(index === n)));
  detail.live = false;
  detail.load = async (robot) => run.robots[robot];
  const find = (report.find ?? "").toLowerCase();
  const rows = run.view.fleet.rows.filter((row) => row.robot.toLowerCase().includes(find) || row.doing.includes(find));
  render({ ...run.view, title: report.title, fleet: { ...run.view.fleet, rows } });
  renderEnergy(run.view.stations, async (station, pack) => run.packs[`${station} ${pack}`]);
}
