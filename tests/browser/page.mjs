// Drives the dashboard at a URL in a real browser and checks what is on the page against the API.
//
//   node page.mjs frozen URL DIR             a simulation that has ended: every number can be compared
//   node page.mjs live URL DIR TOKEN ROBOT   a running fleet: updates arrive, changes need the token, a robot has gone
//   node page.mjs report FILE DIR            a report of a simulation, without a server
//
// Exit status 0 when all holds; what does not is printed. Screenshots go to DIR.
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { chromium } from "playwright-core";

const [mode, target, dir, token, gone] = process.argv.slice(2);
const axe = fs.readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const failures = [];
const check = (holds, what) => { if (!holds) failures.push(what); };
const same = (shown, wanted, what) => check(shown === wanted, `${what}: the page says "${shown}", the API "${wanted}"`);

/** Compares `12.3 ± 0.4 Wh` with a value and its sigma: equal as far as it is told. */
function sameQuantity(text, value, sigma, what) {
  const told = /^(-?[\d.]+) ± ([\d.]+)/.exec(text ?? "");
  if (!told) return check(false, `${what}: "${text}" is no number with a sigma`);
  for (const [shown, wanted] of [[told[1], value], [told[2], sigma]]) {
    const half = 0.5 * 10 ** -(shown.split(".")[1]?.length ?? 0);
    check(Math.abs(Number(shown) - wanted) <= half * 1.000001, `${what}: the page says ${shown}, the API ${wanted}`);
  }
}

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const LOOKS = [["desktop-light", 1440, 1000, "light"], ["desktop-dark", 1440, 1000, "dark"], ["laptop-light", 1280, 800, "light"], ["tablet-dark", 820, 1180, "dark"], ["phone-light", 390, 844, "light"], ["phone-dark", 390, 844, "dark"]];

async function open([name, width, height, colorScheme]) {
  // The page's own rules hold, but axe must get in.
  const context = await browser.newContext({ viewport: { width, height }, colorScheme, bypassCSP: true });
  const page = await context.newPage();
  page.on("console", (message) => check(message.type() !== "error", `${name}: console: ${message.text()}`));
  page.on("pageerror", (error) => check(false, `${name}: ${error.message}`));
  await page.goto(target);
  return page;
}

/** What holds of every page: it fits, it can be used without seeing it, it is looked at. */
async function everywhere(page, name) {
  const beyond = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  check(beyond <= 0, `${name}: the page is ${beyond} pixels wider than the window`);
  const wide = await page.locator(".card").evaluateAll((cards) => cards.filter((card) => card.scrollWidth > card.clientWidth).map((card) => card.className));
  check(wide.length === 0, `${name}: more than fits into ${wide.join(", ")}`);
  await page.screenshot({ path: path.join(dir, `${mode}-${name}.png`), fullPage: true });
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => window.axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21aa"] }));
  for (const violation of violations) check(false, `${name}: ${violation.id}: ${violation.help}: ${violation.nodes.slice(0, 3).map((node) => node.html).join(" | ")}`);
}

const api = async (route) => (await fetch(new URL(`api/v1/${route}`, target))).json();
const texts = (page, selector) => page.locator(selector).allTextContents();

/** Every number of the page against the messages that it was made from. */
async function numbers(page) {
  const [fleet, capacity, schedule] = await Promise.all(["fleet", "capacity", "schedule"].map(api));
  const robots = Object.entries(fleet.robots);
  check(robots.length > 0, "the fleet has robots");
  same(await page.locator("#fleet tbody tr").count(), robots.length, "rows of the fleet");
  for (const [id, { gauge, state }] of robots) {
    const cell = async (label) => (await page.locator(`#fleet tr[data-robot="${id}"] td[data-label="${label}"]`).textContent()).trim();
    sameQuantity(await cell("Charge"), gauge.soc.value * 100, gauge.soc.sigma * 100, `charge of ${id}`);
    sameQuantity(await cell("Energy left"), gauge.remaining_wh.value, gauge.remaining_wh.sigma, `energy left in ${id}`);
    sameQuantity(await cell("Draws at work"), state.drain_w.value, state.drain_w.sigma, `what ${id} draws`);
    check((await cell("Doing")).startsWith(state.phase), `${id} does ${state.phase}: ${await cell("Doing")}`);
  }
  for (const [station, { packs }] of Object.entries(fleet.stations)) {
    for (const [pack, gauge] of Object.entries(packs)) {
      const holder = page.locator(`article[aria-label="Station ${station}"] [data-pack="${pack}"]`);
      sameQuantity(await holder.locator('[data-part="charge"]').textContent(), gauge.soc.value * 100, gauge.soc.sigma * 100, `charge of ${pack}`);
      sameQuantity(await holder.locator('[data-part="more"]').textContent(), gauge.remaining_wh.value, gauge.remaining_wh.sigma, `energy in ${pack}`);
      const parts = await Promise.all(["promised", "free", "reserve"].map((part) => holder.locator(`[data-part="${part}"]`).textContent()));
      const sum = parts.reduce((whole, part) => whole + Number.parseFloat(part), 0);
      check(Math.abs(sum - gauge.remaining_wh.value) < 0.2, `${pack}: ${parts.join(" + ")} is not ${gauge.remaining_wh.value}`);
    }
  }
  same(await page.locator("#capacity-headline").textContent(), `${capacity.robots_promised} more at ${(capacity.confidence * 100).toFixed(0)} %`, "capacity");
  const counts = [...capacity.packs.map((pack) => [`${pack.station} ${pack.pack}`, pack]), ...capacity.stations.map((station) => [`${station.station} together`, station])];
  for (const [label, wanted] of counts) {
    const row = page.locator("#capacity tbody tr").filter({ has: page.locator("th", { hasText: new RegExp(`^${label}$`) }) });
    if (label.endsWith(" together") && (await row.count()) === 0) {
      check(capacity.packs.filter((pack) => pack.station === wanted.station).length === 1, `${label} has no row`);
      continue;
    }
    const [, usable, service, expected, promised, , odds] = await row.locator("th, td").allTextContents();
    sameQuantity(usable, wanted.usable_wh.value, wanted.usable_wh.sigma, `usable energy of ${label}`);
    if (wanted.service_wh) sameQuantity(service, wanted.service_wh.value, wanted.service_wh.sigma, `one service of ${label}`);
    same(`${expected} ${promised}`, `${wanted.robots_expected} ${wanted.robots_promised}`, `robots of ${label}`);
    for (const [, number, sign, percent] of odds.matchAll(/(\d+) at (> )?(\d+) %/g)) {
      const probability = 100 * wanted.promises[number - 1].probability;
      check(sign ? probability > 99 : Math.abs(probability - percent) <= 0.500001 || (percent === "1" && probability < 1), `${label}: the page says ${number} at ${percent} %, the API ${probability}`);
    }
    check((odds === "") === ((wanted.promises ?? []).length === 0), `${label}: "${odds}" for ${JSON.stringify(wanted.promises)}`);
  }
  const past = await page.locator(".bar.past, .bar.failed").count();
  const done = (await api("events?last=500")).filter((event) => event.kind === "service_done" || event.kind === "service_failed").length;
  same(past, done, "services that have ended");
  same((await page.locator(".bar").count()) - past, schedule.services.length, "services of the plan");
  for (const left of schedule.unserved) {
    const why = left.reasons.join("; ");
    check((await texts(page, "#unserved p")).includes(`${left.robot} is left out: ${why}`), `${left.robot} is told to be left out: ${why}`);
  }
}

/** Why on click, and back to where one was; zoom by keys. */
async function byHand(page, why) {
  const button = page.locator("#fleet tbody button").first();
  const robot = await button.textContent();
  await button.focus();
  await page.keyboard.press("Enter");
  await page.locator("#detail-body .reasons").first().waitFor();
  const reasons = await why(robot);
  const told = await texts(page, "#detail-body .reasons:first-of-type > li");
  same(told.join("|"), reasons.join("|"), `why ${robot} is serviced so`);
  check((await page.locator("#detail .u-over").count()) === 1, "the charge of a robot is drawn");
  await page.keyboard.press("Escape");
  check(!(await page.locator("#detail").evaluate((dialog) => dialog.open)), "Escape closes the dialog");
  check(await button.evaluate((element) => element === document.activeElement), "the focus is back where it was");
  const ticks = async () => (await texts(page, "#gantt .axis span")).join(" ");
  const all = await ticks();
  await page.locator("#gantt").focus();
  await page.keyboard.press("+");
  await page.keyboard.press("+");
  check((await ticks()) !== all, "+ zooms into the plan");
  await page.keyboard.press("0");
  same(await ticks(), all, "0 shows the whole plan again");
  check((await page.locator("#energy .u-over").count()) === 1, "the energy of the packs is drawn");
}

async function frozen() {
  for (const look of LOOKS) {
    const page = await open(look);
    await page.locator("#status.quiet").waitFor();
    same(await page.locator("#status-text").textContent(), "ended", "a simulation that has ended");
    check(await page.locator("#outcome-body tbody tr").first().isVisible(), "what came of it is shown");
    check(!(await page.locator("#replan").isVisible()), "nobody can plan anew what has ended");
    await page.locator("#energy .u-over").waitFor();
    if (look[0] === "desktop-light") {
      await numbers(page);
      await byHand(page, async (robot) => (await api(`explain/${robot}`)).reasons);
      await page.locator("#find").fill("nobody");
      await page.waitForFunction(() => document.querySelectorAll("#fleet tbody tr").length === 0);
      check((await page.locator("#fleet-note").textContent()).includes("No robot matches"), "who finds nobody is told so");
      await page.locator("#find").fill("");
      await page.locator("#fleet tbody tr").first().waitFor();
    }
    await everywhere(page, look[0]);
    await page.context().close();
  }
}

async function live() {
  const page = await open(LOOKS[0]);
  await page.locator("#status.good").waitFor();
  await page.locator("#fleet tbody tr").first().waitFor();
  const state = () => page.evaluate(() => [document.getElementById("clock").textContent, document.querySelector("#fleet tbody").textContent].join("\n"));
  const before = await state();
  await page.waitForFunction((then) => [document.getElementById("clock").textContent, document.querySelector("#fleet tbody").textContent].join("\n") !== then, before);
  const plan = async () => (await api("schedule")).plan;
  const first = await plan();
  await page.locator("#replan").click();
  await page.locator("#token").fill("a wrong token, surely");
  // The browser itself tells the console of the refusal that is asked for here.
  page.removeAllListeners("console");
  await page.locator("#token-form [type=submit]").click();
  await page.waitForFunction(() => document.getElementById("token-error").textContent !== "");
  check((await page.locator("#token-error").textContent()).includes("web.token"), "a wrong token is refused, and told why");
  await page.locator("#token").fill(token);
  await page.locator("#token-form [type=submit]").click();
  await page.locator("#token-dialog").waitFor({ state: "hidden" });
  for (let n = 0; n < 50 && (await plan()) <= first; n += 1) await page.waitForTimeout(100);
  check((await plan()) > first, "the right token makes a new plan");
  // Its agent has ended: it is gone for good if somebody says so, and the token is known by now.
  const row = page.locator("#fleet tbody button", { hasText: gone });
  await page.waitForFunction(async (robot) => (await (await fetch("api/v1/fleet")).json()).robots[robot]?.lost, gone);
  await row.click();
  await page.locator("#detail-body button", { hasText: "Forget it" }).click();
  await page.locator("#detail").waitFor({ state: "hidden" });
  await row.waitFor({ state: "detached" });
  check(!(gone in (await api("fleet")).robots), "a robot that is forgotten is not known any more");
  await everywhere(page, "desktop-light");
}

async function report() {
  for (const look of LOOKS) {
    const page = await open(look);
    await page.locator("#outcome-body tbody tr").first().waitFor();
    const data = await page.evaluate(() => JSON.parse(document.getElementById("data").textContent));
    if (look[0] === "desktop-light") {
      for (const [n, run] of data.runs.entries()) {
        if (data.runs.length > 1) await page.locator("#runs button").nth(n).click();
        same(await page.locator("#capacity-headline").textContent(), run.view.capacity.headline, `capacity of ${run.name}`);
        same(await page.locator("#fleet tbody tr").count(), run.view.fleet.rows.length, `robots of ${run.name}`);
        await byHand(page, async (robot) => run.robots[robot].reasons);
      }
    }
    await everywhere(page, look[0]);
    await page.context().close();
  }
}

try {
  await { frozen, live, report }[mode]();
} catch (error) {
  failures.push(error.stack);
}
await browser.close();
failures.forEach((failure) => console.log(failure));
console.log(failures.length === 0 ? "all holds" : `${failures.length} do not hold`);
process.exitCode = failures.length === 0 ? 0 : 1;
