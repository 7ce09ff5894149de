// Tiles, capacity, models, events.

function renderTiles(tiles) {
  keyed(byId("tiles"), tiles, (tile) => tile.id,
    (tile) => h("div", { class: "tile", "data-tile": tile.id }, h("dt", { "data-part": "label" }), h("dd", { class: "value", "data-part": "value" }), h("dd", { class: "muted", "data-part": "note" })),
    (element, tile) => {
      setClass(element, `tile ${tile.tone}`);
      for (const name of ["label", "value", "note"]) setText(part(element, name), tile[name]);
    });
}

function renderCapacity(capacity) {
  setText(byId("capacity-headline"), capacity.headline);
  setText(byId("capacity-note"), capacity.note);
  setText(byId("capacity-promised"), capacity.certain);
  const names = ["label", "usable", "service", "expected", "promised", "short", "odds"];
  keyed(byId("capacity").tBodies[0], capacity.packs, (pack) => pack.label,
    () => h("tr", {}, h("th", { scope: "row", "data-part": "label" }), ...names.slice(1).map((name) => h("td", { class: name === "odds" ? "odds" : names.indexOf(name) > 2 ? "number num" : "num", "data-part": name }))),
    (element, pack) => {
      for (const name of names) setText(part(element, name), String(pack[name]?.text ?? pack[name] ?? ""));
      part(element, "odds").title = pack.who;
    });
  keyed(byId("breakdowns"), capacity.breakdowns.entries(), ([n]) => n,
    ([n]) => h("div", {}, h("h3", { id: `causes-${n}`, "data-part": "title" }), h("ul", { class: "bars", "aria-labelledby": `causes-${n}`, "data-part": "causes" })),
    (element, [, breakdown]) => {
      setText(part(element, "title"), breakdown.title);
      renderCauses(part(element, "causes"), breakdown.causes);
    });
}

function renderCauses(list, causes) {
  keyed(list, causes, (cause) => cause.cause,
    () => h("li", {}, h("span", { class: "bar-label", "data-part": "cause" }), h("span", { class: "bar-track", "aria-hidden": "true" }, h("i", { "data-part": "bar" })), h("span", { class: "num", "data-part": "number" })),
    (element, cause) => {
      setText(part(element, "cause"), cause.cause);
      setText(part(element, "number"), cause.number);
      setStyle(part(element, "bar"), "width", share(cause.share));
    });
}

function makeWatched() {
  return h("li", {}, h("div", { class: "watch-head" }, h("span", { "data-part": "subject" }), h("span", { class: "small", "data-part": "state" }),
    h("span", { class: "meter", "aria-hidden": "true" }, h("i", { "data-part": "evidence" })), h("span", { class: "num", "data-part": "z" })),
    h("div", { class: "command", "data-part": "command" }, h("code", { "data-part": "code" }), copyButton()));
}

function copyButton() {
  return h("button", { type: "button", class: "plain", "aria-label": "Copy the command", onclick: async (event) => {
    const button = event.currentTarget;
    const text = button.parentElement.querySelector("code").textContent;
    const copied = await navigator.clipboard?.writeText(text).then(() => true, () => false);
    setText(button, copied ? "Copied" : "Select it");
    setTimeout(() => setText(button, "Copy"), 2000);
  } }, "Copy");
}

function updateWatched(element, row) {
  setText(part(element, "subject"), row.subject);
  setText(part(element, "z"), row.z_text);
  setStyle(part(element, "evidence"), "width", share(row.evidence * 100));
  setClass(part(element, "evidence"), row.tone);
  setClass(part(element, "state"), `tone small ${row.tone}`);
  setText(part(element, "state"), row.state);
  part(element, "command").hidden = !row.command;
  setText(part(element, "code"), row.command);
}

function renderHealth(health) {
  setText(byId("health-headline"), health.headline);
  keyed(byId("health"), health.rows, (row) => row.subject, makeWatched, updateWatched);
  const { ladder } = health;
  setText(byId("ladder-head"), ladder ? `${ladder.model}: ${ladder.verdict} (${ladder.source})` : health.ladder_note);
  keyed(byId("ladder"), ladder?.steps ?? [], (step) => `${step.channel} ${step.effect}`,
    () => h("li", {}, h("span", { class: "bar-label", "data-part": "effect" }), h("span", { class: "bar-track", "aria-hidden": "true" }, h("i", { "data-part": "bar" })), h("span", { class: "num small", "data-part": "text" })),
    (element, step) => {
      setText(part(element, "effect"), `${step.effect}`);
      setText(part(element, "text"), step.text);
      setStyle(part(element, "bar"), "width", share(step.share * 100));
    });
}

function renderEvents(events) {
  const some = byId("events-some").checked;
  const shown = some ? events.filter((event) => event.tone === "warn" || event.tone === "bad") : events;
  keyed(byId("events"), shown, (event) => event.seq,
    (event) => h("li", {}, h("time", { class: "num muted" }, event.clock), h("span", { class: `tone ${event.tone}` }, event.label), h("span", {}, event.text)), () => {});
  announce(events);
}

/** Tells screen readers of new events that need somebody; not of those that were there before. */
function announce(events) {
  const newest = events[0]?.seq ?? 0;
  const news = events.filter((event) => announce.last !== undefined && event.seq > announce.last && (event.tone === "bad" || event.tone === "warn"));
  if (news.length > 0) setText(byId("announce"), news.map((event) => `${event.label}: ${event.text}`).join(". "));
  announce.last = newest;
}
