// The fleet's table.

function makeRobotRow(row) {
  const cell = (label, ...children) => h("td", { role: "cell", "data-label": label }, ...children);
  const bar = h("div", { class: "gauge", "aria-hidden": "true" },
    h("i", { class: "gauge-fill", "data-part": "fill" }), h("i", { class: "gauge-band", "data-part": "band" }), h("i", { class: "gauge-tick", "data-part": "tick" }));
  return h("tr", { role: "row", "data-robot": row.robot },
    h("th", { role: "rowheader", scope: "row", "data-label": "Robot" },
      h("button", { type: "button", class: "link", "aria-haspopup": "dialog", onclick: () => openDetail(row.robot) }, row.robot),
      h("span", { class: "badge warn", "data-part": "doubt" }, "model doubted")),
    cell("Doing", h("span", { "data-part": "doing" })),
    cell("Charge", bar, h("span", { class: "num", "data-part": "charge" })),
    cell("Energy left", h("span", { class: "num", "data-part": "remaining" })),
    cell("Time left", h("span", { class: "num", "data-part": "time" })),
    cell("Draws at work", h("span", { class: "num", "data-part": "drain" })),
    cell("Service", h("span", { "data-part": "service" })));
}

function updateRobotRow(element, row) {
  const doing = part(element, "doing");
  setClass(doing, `tone ${row.tone}`);
  setText(doing, row.doing);
  part(element, "doubt").hidden = !row.doubted;
  setText(part(element, "charge"), row.charge?.text ?? "–");
  const [low, high] = row.charge_band ?? [0, 0];
  const fill = part(element, "fill");
  setStyle(fill, "width", share(row.charge?.value ?? 0));
  setClass(fill, `gauge-fill${row.charge && row.charge.value < row.wanted_below ? " low" : ""}`);
  setStyle(part(element, "band"), "left", share(low));
  setStyle(part(element, "band"), "width", share(high - low));
  setStyle(part(element, "tick"), "left", share(row.wanted_below));
  setText(part(element, "remaining"), row.remaining?.text ?? "–");
  setText(part(element, "time"), row.time ? (row.filling ? `full in ${row.time.text}` : row.time.text) : "–");
  setText(part(element, "drain"), row.drain?.text ?? "–");
  setText(part(element, "service"), row.service || "–");
}

function renderFleet(fleet) {
  keyed(byId("fleet").tBodies[0], fleet.rows, (row) => row.robot, makeRobotRow, updateRobotRow);
  setText(byId("fleet-note"), fleet.note);
}
