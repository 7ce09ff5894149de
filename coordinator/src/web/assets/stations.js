// Stations: packs as stacked energy, bays, spares.

function makeStation(card) {
  return h("article", { class: "station", "aria-label": `Station ${card.station}` },
    h("header", {}, h("h3", {}, card.station), h("p", { "data-part": "state" })),
    h("div", { "data-part": "packs" }),
    h("ul", { class: "chips", "data-part": "bays", "aria-label": "Bays" }),
    h("ul", { class: "chips", "data-part": "spares", "aria-label": "Spares" }));
}

function updateStation(element, card) {
  const state = part(element, "state");
  setClass(state, `tone ${card.tone}`);
  setText(state, card.state);
  keyed(part(element, "packs"), card.packs, (pack) => pack.pack, makePack, updatePack);
  keyed(part(element, "bays"), card.bays, (bay) => bay.bay, makeChip, (chip, bay) =>
    updateChip(chip, bay.bay, bay.robot ? `${bay.robot}, ${bay.state}` : bay.state, bay.tone));
  keyed(part(element, "spares"), card.spares, (spare) => spare.spare, makeChip, (chip, spare) =>
    updateChip(chip, spare.spare, `${spare.charge.text}, ${spare.state}`, spare.tone));
  part(element, "spares").hidden = card.spares.length === 0;
}

function makePack(pack) {
  const legend = (name, words) => h("div", {}, h("dt", {}, h("i", { class: `swatch ${name}`, "aria-hidden": "true" }), words), h("dd", { class: "num", "data-part": name }));
  return h("div", { class: "pack", "data-pack": pack.pack },
    h("p", { class: "pack-head" }, h("strong", {}, pack.pack), " ", h("span", { "data-part": "state" }), h("span", { class: "num right", "data-part": "charge" })),
    h("div", { class: "stack", "aria-hidden": "true" },
      h("i", { class: "promised", "data-part": "promised-bar" }), h("i", { class: "free", "data-part": "free-bar" }),
      h("i", { class: "reserve", "data-part": "reserve-bar" }), h("i", { class: "whisker", "data-part": "whisker" })),
    h("dl", { class: "stack-numbers" }, legend("promised", "promised"), legend("free", "free"), legend("reserve", "reserve")),
    h("p", { class: "muted small num", "data-part": "more" }));
}

function updatePack(element, pack) {
  const state = part(element, "state");
  setClass(state, pack.state ? `badge ${pack.tone}` : "");
  setText(state, pack.state);
  setText(part(element, "charge"), pack.charge?.text ?? "–");
  const stack = pack.stack;
  const full = stack?.full.value || 1;
  for (const name of ["promised", "free", "reserve"]) {
    setText(part(element, name), stack?.[name].text ?? "–");
    setStyle(part(element, `${name}-bar`), "width", share(((stack?.[name].value ?? 0) / full) * 100));
  }
  const left = stack?.remaining ?? { value: 0, sigma: 0 };
  const whisker = part(element, "whisker");
  whisker.hidden = !stack;
  setStyle(whisker, "left", share(((left.value - left.sigma) / full) * 100));
  setStyle(whisker, "width", share(((2 * left.sigma) / full) * 100));
  const more = stack ? [`${stack.remaining.text} of ${stack.full.text}`] : [];
  if (pack.time_to_empty) more.push(`empty in ${pack.time_to_empty.text}`);
  more.push(...pack.readings.map((reading) => reading.text));
  setText(part(element, "more"), more.join(" · "));
}

function makeChip() {
  return h("li", {}, h("strong", { "data-part": "name" }), " ", h("span", { "data-part": "text" }));
}

function updateChip(element, name, text, tone) {
  setClass(element, `chip ${tone}`);
  setText(part(element, "name"), name);
  setText(part(element, "text"), text);
}

function renderStations(stations) {
  keyed(byId("stations"), stations, (card) => card.station, makeStation, updateStation);
}

/** Energy of packs over time; `fetchSeries(station, pack)` gives one of them. */
async function renderEnergy(stations, fetchSeries) {
  const packs = stations.flatMap((card) => card.packs.map((pack) => [card.station, pack.pack])).slice(0, SERIES_COLOURS.length);
  const alone = stations.length === 1;
  const series = await Promise.all(packs.map(async ([station, pack]) => {
    const one = await fetchSeries(station, pack).catch(() => null);
    return one && { name: alone ? pack : `${station} ${pack}`, ...one };
  }));
  drawSeries(byId("energy"), series.filter(Boolean), "Wh", 1, 220);
}
