// Quantities over time, each with a band of one sigma.

const SERIES_COLOURS = ["--series-1", "--series-2", "--series-3", "--series-4", "--series-5", "--series-6"];

const cssColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/**
 * Draws named series into `holder`; the chart is kept and only its data change.
 * `series`: [{ name, time_s, value, sigma }], `scale` multiplies values and sigmas.
 */
function drawSeries(holder, series, unit, scale, height, range) {
  const shown = series.filter((one) => one.time_s.length > 1);
  if (shown.length === 0) {
    holder.chart?.destroy();
    holder.chart = null;
    holder.replaceChildren(h("p", { class: "muted" }, "Nothing to draw yet."));
    return;
  }
  const tables = shown.map((one) => {
    const value = one.value.map((v) => v * scale);
    const low = one.value.map((v, i) => (v - one.sigma[i]) * scale);
    const high = one.value.map((v, i) => (v + one.sigma[i]) * scale);
    return [one.time_s, value, low, high];
  });
  const data = uPlot.join(tables);
  holder.redraw = () => drawSeries(holder, series, unit, scale, height, range);
  const theme = document.documentElement.dataset.shown;
  const kind = `${theme}|${unit}|${shown.map((one) => one.name).join("|")}`;
  if (holder.chart && holder.kind === kind) {
    holder.chart.setData(data);
    setAttribute(holder.figure, "aria-label", describe(shown, unit, scale));
    return;
  }
  holder.chart?.destroy();
  holder.figure = h("div", { role: "img", "aria-label": describe(shown, unit, scale) });
  holder.replaceChildren(holder.figure);
  holder.kind = kind;
  holder.chart = new uPlot(options(holder, shown, unit, height, range), data, holder.figure);
}

/** What a chart shows, for those who do not see it. */
function describe(series, unit, scale) {
  const last = (one) => `${one.name} ${(one.value.at(-1) * scale).toFixed(1)} ± ${(one.sigma.at(-1) * scale).toFixed(1)} ${unit}`;
  return `Over time, now: ${series.map(last).join("; ")}`;
}

function options(holder, series, unit, height, range) {
  const ink = cssColour("--muted");
  const grid = { stroke: cssColour("--line"), width: 1 };
  const font = "12px system-ui, sans-serif";
  const axis = { stroke: ink, grid, ticks: { show: false }, font };
  // Without a cursor the legend tells the last value.
  const number = (chart, _, column, at) => {
    const [value, high] = [chart.data[column], chart.data[column + 2]];
    const row = at != null && value[at] != null ? at : value.findLastIndex((each) => each != null);
    return row < 0 ? "–" : `${value[row].toFixed(1)} ± ${(high[row] - value[row]).toFixed(1)} ${unit}`;
  };
  const columns = [{ label: "UTC", value: (chart, s) => new Date((s ?? chart.data[0].at(-1)) * 1000).toISOString().slice(11, 19) }];
  const bands = [];
  series.forEach((one, n) => {
    const colour = cssColour(SERIES_COLOURS[n % SERIES_COLOURS.length]);
    const first = columns.length;
    columns.push({ label: one.name, stroke: colour, width: 2, value: number, spanGaps: true });
    columns.push({ label: `${one.name} − σ`, stroke: "transparent", width: 0, points: { show: false }, spanGaps: true });
    columns.push({ label: `${one.name} + σ`, stroke: "transparent", width: 0, points: { show: false }, spanGaps: true });
    bands.push({ series: [first + 2, first + 1], fill: colour + "55" });
  });
  return {
    width: Math.max(240, holder.clientWidth),
    height,
    padding: [8, 8, 0, 0],
    tzDate: (s) => uPlot.tzDate(new Date(s * 1000), "Etc/UTC"),
    scales: { y: { range: range ?? ((_, low, high) => [Math.min(0, low), Math.max(high * 1.05, 1)]) } },
    axes: [{ ...axis, values: (_, ticks) => ticks.map((s) => (ticks[1] - ticks[0] < 60 ? secondsText : clockText)(s * 1000)) }, { ...axis, size: 52, values: (_, ticks) => ticks.map((v) => `${v} ${unit}`) }],
    series: columns,
    bands,
    legend: { show: true },
    cursor: { drag: { x: false, y: false }, points: { size: 7 } },
  };
}

/** Draws every chart again, in other colours. */
const redrawCharts = () => document.querySelectorAll(".chart").forEach((holder) => holder.redraw?.());

/** Charts follow the width of their holders. */
const widths = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    if (target.chart && Math.abs(target.chart.width - target.clientWidth) > 1) {
      target.chart.setSize({ width: Math.max(240, target.clientWidth), height: target.chart.height });
    }
  }
});
