// The plan: lanes and services over time. The window is the page's own; all else is the server's.

const plan = { chart: null, window: null };
const MINUTE = 60e3;
const STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 180, 360, 720, 1440].map((minutes) => minutes * MINUTE);

/** The window that shows everything, or the one that was zoomed to. */
function planWindow() {
  const { from, to } = plan.chart;
  const margin = (to - from) * 0.02;
  return plan.window ?? [from - margin, to + margin];
}

function zoomPlan(what, centre = 0.5) {
  if (!plan.chart) return;
  const [from, to] = planWindow();
  const span = to - from;
  const whole = Math.max(plan.chart.to - plan.chart.from, 60 * MINUTE) * 4;
  const resized = (factor) => {
    const next = Math.min(Math.max(span * factor, 5 * MINUTE), whole);
    const at = from + span * centre;
    return [at - next * centre, at + next * (1 - centre)];
  };
  const moved = (by) => [from + span * by, to + span * by];
  plan.window = { in: () => resized(0.6), out: () => resized(1 / 0.6), earlier: () => moved(-0.25), later: () => moved(0.25), fit: () => null }[what]();
  drawPlan();
}

function makeLane(lane) {
  return h("div", { class: "lane", role: "group", "aria-label": lane.label }, h("span", { class: "lane-label" }, ...whole(lane.label)), h("div", { class: "lane-bars", "data-part": "bars" }));
}

function makeBar(bar) {
  return h("div", { class: "service" }, h("i", { class: "way", "data-part": "way" }),
    h("button", { type: "button", "data-part": "bar", "aria-haspopup": "dialog", "data-robot": bar.robot, onclick: () => openDetail(bar.robot) }, bar.robot));
}

function updateBar(element, bar, at) {
  const button = part(element, "bar");
  setClass(button, `bar ${bar.stage} ${bar.mode}`);
  setAttribute(button, "aria-label", bar.text);
  setAttribute(button, "title", bar.text);
  place(button, at(bar.start), at(bar.end));
  place(part(element, "way"), at(bar.leave), at(bar.start));
  element.hidden = at(bar.end) < 0 || at(bar.leave) > 100;
}

/** Puts an element from one percentage of the width to another. */
function place(element, from, to) {
  const [left, right] = [Math.max(from, -1), Math.min(to, 101)];
  setStyle(element, "left", `${left.toFixed(3)}%`);
  setStyle(element, "width", `${Math.max(right - left, 0).toFixed(3)}%`);
}

function drawPlan() {
  const [from, to] = planWindow();
  const at = (ms) => ((ms - from) / (to - from)) * 100;
  const holder = byId("gantt");
  if (!holder.lanes) {
    holder.axis = h("div", { class: "axis", "aria-hidden": "true" });
    holder.grid = h("div", { class: "grid", "aria-hidden": "true" });
    holder.nowLine = h("i", { class: "now" });
    holder.lanes = h("div", { class: "lanes" });
    holder.append(h("div", { class: "axis-row" }, h("span", { class: "lane-label muted" }, "UTC"), holder.axis), h("div", { class: "plot" }, holder.grid, holder.lanes));
    holder.grid.append(holder.nowLine);
    holder.grid.lines = h("div");
    holder.grid.append(holder.grid.lines);
  }
  const room = Math.max(3, Math.floor(holder.axis.clientWidth / 90));
  const step = STEPS.find((each) => (to - from) / each <= room) ?? STEPS.at(-1) * Math.ceil((to - from) / STEPS.at(-1) / room);
  const ticks = [];
  for (let tick = Math.ceil(from / step) * step; tick < to; tick += step) ticks.push(tick);
  keyed(holder.axis, ticks, (tick) => tick, () => h("span"), (span, tick) => {
    setText(span, clockText(tick));
    // Cut off at an edge it would say something else.
    span.hidden = at(tick) < 3 || at(tick) > 97;
    setStyle(span, "left", `${at(tick).toFixed(3)}%`);
  });
  keyed(holder.grid.lines, ticks, (tick) => tick, () => h("i"), (line, tick) => setStyle(line, "left", `${at(tick).toFixed(3)}%`));
  setStyle(holder.nowLine, "left", `${at(plan.chart.now).toFixed(3)}%`);
  holder.nowLine.hidden = at(plan.chart.now) < 0 || at(plan.chart.now) > 100;
  keyed(holder.lanes, plan.chart.lanes, (lane) => lane.label, makeLane, (element, lane) =>
    keyed(part(element, "bars"), lane.bars, (bar) => bar.id, makeBar, (bar, data) => updateBar(bar, data, at)));
}

function renderPlan(chart) {
  plan.chart = chart;
  drawPlan();
  const rows = chart.lanes.flatMap((lane) => lane.bars.map((bar) => ({ ...bar, lane: lane.label })));
  if (byId("plan-details").open) {
    keyed(byId("plan-table").tBodies[0], rows, (row) => `${row.lane} ${row.id}`,
      (row) => h("tr", {}, h("td", { "data-part": "lane" }), h("th", { scope: "row" }, h("button", { type: "button", class: "link", onclick: () => openDetail(row.robot) }, row.robot)), h("td", { "data-part": "text" })),
      (element, row) => { setText(part(element, "lane"), row.lane); setText(part(element, "text"), row.text); });
  }
  keyed(byId("unserved"), chart.unserved, (left) => left.robot,
    (left) => h("p", { class: "left-out" }, h("strong", {}, h("button", { type: "button", class: "link", onclick: () => openDetail(left.robot) }, left.robot)), h("span", { "data-part": "what" }), h("span", { "data-part": "why" })),
    (element, left) => {
      element.classList.toggle("quiet", !left.runs_empty);
      setText(part(element, "what"), left.runs_empty ? " is left out: " : " has no service: ");
      setText(part(element, "why"), left.reasons.join("; "));
    });
}

function listenToPlan() {
  const holder = byId("gantt");
  document.querySelectorAll("[data-zoom]").forEach((button) => button.addEventListener("click", () => zoomPlan(button.dataset.zoom)));
  const keys = { "+": "in", "=": "in", "-": "out", ArrowLeft: "earlier", ArrowRight: "later", 0: "fit" };
  holder.addEventListener("keydown", (event) => {
    const what = keys[event.key];
    if (!what || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    zoomPlan(what);
  });
  holder.addEventListener("wheel", (event) => {
    // Without Ctrl the wheel scrolls the page, as everywhere.
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    const box = holder.axis.getBoundingClientRect();
    zoomPlan(event.deltaY < 0 ? "in" : "out", Math.min(1, Math.max(0, (event.clientX - box.left) / box.width)));
  }, { passive: false });
  byId("plan-details").addEventListener("toggle", () => plan.chart && renderPlan(plan.chart));
  new ResizeObserver(() => plan.chart && drawPlan()).observe(holder);
}
