// From the server's view to the page.

function render(view) {
  document.title = `${view.title} – Tender`;
  setText(byId("title"), view.title);
  setText(byId("headline"), view.headline);
  setText(byId("clock"), view.clock);
  renderTiles(view.tiles);
  renderPlan(view.plan);
  renderFleet(view.fleet);
  renderStations(view.stations);
  renderCapacity(view.capacity);
  renderHealth(view.health);
  renderEvents(view.events);
  render.last = view;
}

/** Asks the server; what it refuses becomes an error with its reason. */
async function ask(path, init) {
  const response = await fetch(path, init);
  const answer = await response.json().catch(() => ({ error: `${response.status} ${response.statusText}` }));
  if (!response.ok) throw Object.assign(new Error(answer.error), { status: response.status });
  return answer;
}

const robotPath = (robot) => `api/v1/view/robot/${encodeURIComponent(robot)}`;
const packPath = (station, pack) => `api/v1/view/pack/${encodeURIComponent(station)}/${encodeURIComponent(pack)}`;

/** Follows the coordinator; the browser comes back by itself when the line was cut. */
function follow() {
  const live = { stream: null, heard: 0, energy: 0 };
  const say = (text, tone) => { setText(byId("status-text"), text); setClass(byId("status"), `status ${tone}`); };
  const open = () => {
    live.stream?.close();
    const wanted = new URLSearchParams({ find: byId("find").value, sort: byId("sort").value });
    live.stream = new EventSource(`api/v1/live?${wanted}`);
    live.stream.addEventListener("view", (event) => {
      live.heard = Date.now();
      const view = JSON.parse(event.data);
      if (view.ended) say("ended", "quiet");
      else say("live", "good");
      // What a simulation does was decided before.
      byId("replan").hidden = view.simulated;
      renderOutcome(view.ended);
      render(view);
      if (live.heard - live.energy > 5000) {
        live.energy = live.heard;
        renderEnergy(view.stations, (station, pack) => ask(packPath(station, pack)));
      }
    });
    live.stream.addEventListener("busy", () => say("the coordinator does not answer", "warn"));
    live.stream.addEventListener("error", () => {
      say("no connection, trying again", "bad");
      if (live.stream.readyState === EventSource.CLOSED) setTimeout(open, 2000);
    });
  };
  setInterval(() => live.heard && Date.now() - live.heard > 5000 && say("no news for some seconds", "warn"), 1000);
  detail.live = true;
  detail.load = (robot) => ask(robotPath(robot));
  listenToFleetForm(open);
  listenToChanges();
  open();
}

function listenToFleetForm(changed) {
  let timer;
  const soon = () => { clearTimeout(timer); timer = setTimeout(() => changed(byId("find").value, byId("sort").value), 200); };
  byId("find").addEventListener("input", soon);
  byId("sort").addEventListener("change", soon);
  byId("fleet-form").addEventListener("submit", (event) => event.preventDefault());
}

/** Changes something, for which the server wants the token: it is asked for once. `done` follows what was done. */
function change(name, path, method, done) {
  const keep = { get: () => { try { return sessionStorage.getItem("tender-token"); } catch { return null; } },
    set: (token) => { try { sessionStorage.setItem("tender-token", token); } catch { /* asked again next time */ } } };
  const act = (token) => ask(path, { method, headers: { Authorization: `Bearer ${token}` } });
  const dialog = byId("token-dialog");
  const askForToken = (error) => {
    setText(byId("token-title"), name);
    setText(byId("token-submit"), name);
    setText(byId("token-error"), error);
    byId("token-form").onsubmit = async (event) => {
      event.preventDefault();
      try {
        await act(byId("token").value);
        keep.set(byId("token").value);
        byId("token").value = "";
        dialog.close();
        done?.();
      } catch (error) {
        setText(byId("token-error"), error.message);
      }
    };
    dialog.showModal();
  };
  const token = keep.get();
  if (!token) return askForToken("");
  return act(token).then(() => done?.(), (error) => askForToken(error.status === 401 ? "" : error.message));
}

/** Why nothing can be changed from here; nothing where it can. */
const unchangeable = document.body.dataset.unchangeable;

function listenToChanges() {
  byId("replan").disabled = Boolean(unchangeable);
  setAttribute(byId("replan"), "title", unchangeable);
  byId("replan").addEventListener("click", () => change("Plan anew", "api/v1/replan", "POST"));
  detail.forget = (robot) => change(`Forget ${robot}`, `api/v1/robot/${encodeURIComponent(robot)}`, "DELETE", () => byId("detail").close());
}

/** Colours: as the system says, or as was chosen here. */
function listenToTheme() {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const choices = ["auto", "light", "dark"];
  const names = { auto: ["◐", "as the system"], light: ["☀", "light"], dark: ["☾", "dark"] };
  const stored = () => { try { return localStorage.getItem("tender-theme"); } catch { return null; } };
  let choice = choices.includes(stored()) ? stored() : "auto";
  const show = () => {
    const root = document.documentElement;
    root.dataset.shown = choice === "auto" ? (dark.matches ? "dark" : "light") : choice;
    const [sign, words] = names[choice];
    setText(byId("theme"), sign);
    setAttribute(byId("theme"), "aria-label", `Colours: ${words}`);
    setAttribute(byId("theme"), "title", `Colours: ${words}`);
    redrawCharts();
  };
  byId("theme").addEventListener("click", () => {
    choice = choices[(choices.indexOf(choice) + 1) % choices.length];
    try { localStorage.setItem("tender-theme", choice); } catch { /* chosen for this page only */ }
    show();
  });
  dark.addEventListener("change", show);
  show();
}

listenToTheme();
listenToDialogs();
listenToPlan();
widths.observe(byId("energy"));
byId("events-some").addEventListener("change", () => render.last && renderEvents(render.last.events));
const data = byId("data");
if (data) showReport(JSON.parse(data.textContent));
else follow();
