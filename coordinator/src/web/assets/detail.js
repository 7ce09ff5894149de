// One robot in full: opened from a row, a service, or a link.

const detail = { robot: null, load: null, timer: null };

async function openDetail(robot) {
  detail.robot = robot;
  setText(byId("detail-title"), robot);
  setText(byId("detail-doing"), "");
  byId("detail-body").replaceChildren(h("p", { class: "muted" }, "Asking the coordinator …"));
  byId("detail").showModal();
  clearInterval(detail.timer);
  await refreshDetail();
  if (detail.robot !== robot || !byId("detail").open) return;
  clearInterval(detail.timer);
  if (detail.live) detail.timer = setInterval(refreshDetail, 2000);
}

async function refreshDetail() {
  const robot = detail.robot;
  let shown;
  try {
    shown = await detail.load(robot);
  } catch (error) {
    if (detail.robot !== robot) return;
    byId("detail-body").replaceChildren(h("p", { class: "bad-text" }, error.message));
    return;
  }
  if (detail.robot !== robot || !byId("detail").open) return;
  const doing = byId("detail-doing");
  setClass(doing, `tone ${shown.tone}`);
  setText(doing, shown.doing);
  const body = byId("detail-body");
  const text = JSON.stringify({ ...shown, at: 0, charge: 0 });
  if (body.shown !== `${robot}${text}` || !body.chart?.isConnected) {
    body.shown = `${robot}${text}`;
    body.chart = body.chart?.dataset.robot === robot ? body.chart : h("div", { class: "chart", "data-robot": robot });
    body.replaceChildren(...detailParts(shown), h("h3", {}, "Charge over time"), body.chart);
    widths.observe(body.chart);
  }
  drawSeries(body.chart, [{ name: "charge", ...shown.charge }], "%", 100, 180, () => [0, 100]);
}

function detailParts(shown) {
  const list = (items) => h("ul", { class: "reasons" }, ...items.map((item) => h("li", {}, item)));
  const parts = [h("h3", {}, "Why"), h("p", { class: "detail-service" }, shown.service), list(shown.reasons)];
  for (const doubt of shown.doubts) {
    parts.push(h("div", { class: "doubt" }, h("p", {}, doubt.text), h("div", { class: "command" }, h("code", {}, doubt.command), copyButton())));
  }
  if (shown.alternatives.length > 0) {
    parts.push(h("h3", {}, "What else there is"), h("ul", { class: "reasons" }, ...shown.alternatives.map((other) =>
      h("li", {}, h("strong", {}, other.what), `: ${other.when}`, other.why_not.length ? h("ul", {}, ...other.why_not.map((why) => h("li", {}, why))) : null))));
  }
  parts.push(h("h3", {}, "What its gauge says"), h("dl", { class: "facts" }, ...shown.facts.map((fact) => h("div", {}, h("dt", {}, fact.label), h("dd", { class: "num" }, fact.text)))));
  if (shown.may_forget && detail.forget) {
    const forget = h("button", { type: "button", class: "plain", disabled: Boolean(unchangeable), title: unchangeable }, "Forget it");
    forget.addEventListener("click", () => detail.forget(shown.robot));
    parts.push(h("h3", {}, "Gone for good?"), h("p", { class: "muted" }, "Nothing is planned for it any more, and nobody is told that it is lost. Should it speak again, it is known again."), forget);
  }
  return parts;
}

function listenToDialogs() {
  for (const dialog of document.querySelectorAll("dialog")) {
    dialog.querySelectorAll("[data-close]").forEach((button) => button.addEventListener("click", () => dialog.close()));
    // A click beside the dialog closes it.
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  }
  byId("detail").addEventListener("close", () => { clearInterval(detail.timer); detail.robot = null; });
}
