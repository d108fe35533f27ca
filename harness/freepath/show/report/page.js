"use strict";
// All text goes into the page as textContent, so a name is never markup.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const rows = data.rows.map((cells) => Object.fromEntries(cells.map((cell, i) => [data.fields[i], cell])));
  const element = (id) => document.getElementById(id);
  const MOST = 80, PAGE = 50;
  const views = {};
  let sorted = { column: null, up: true }, place = 0, chosen = [];

  for (const row of rows) {
    row.text = [row.method, row.device, row.q, row.arithmetic, row.storage, row.lanes + " lanes", row.status].join(" ").toLowerCase();
  }
  const prefixes = [[1e-12, "p"], [1e-9, "n"], [1e-6, "u"], [1e-3, "m"], [1, ""]];
  const seconds = (value) => {
    if (value === null || value === "never") return value ?? "";
    const [scale, prefix] = prefixes.find(([one]) => value < 999.5 * one) ?? prefixes[4];
    return `${Number((value / scale).toPrecision(3))} ${prefix}s`;
  };
  const until = (row, name) => (row.unknown.includes(name) ? "?" : row.rough.includes(name) ? "~" : "") + seconds(row[name]);
  const short = (value) => (value === null ? "" : String(Number(value.toPrecision(3))));
  const percent = (value) => (value === null ? "" : `${(100 * value).toFixed(0)}%`);
  const signed = (row) => row.bias === null ? "" :
    `${row.bias < 0 ? "" : "+"}${short(100 * row.bias)}${row.bias_width ? "±" + Number((100 * row.bias_width).toPrecision(2)) : ""}%`;
  const columns = [
    ["case", "method", (row) => row.method, true], ["lanes", "lanes", (row) => row.lanes],
    ["arithmetic", "arithmetic", (row) => row.arithmetic, true],
    ["storage", "storage", (row) => row.storage, true], ["lookups", "lookups", (row) => short(row.lookups)],
    ["time", "t", (row) => seconds(row.t)], ["occ.", "occupancy", (row) => percent(row.occupancy)],
    ["rel. var.", "v", (row) => short(row.v)], ["bias", "bias", signed],
    ["to 10 %", "t10", (row) => until(row, "t10")], ["to 1 %", "t1", (row) => until(row, "t1")],
    ["to 0.1 %", "t01", (row) => until(row, "t01")], ["medium", "q", (row) => row.q, true],
    ["device", "device", (row) => row.device, true], ["status", "status", (row) => row.status, true],
  ].filter(([, field]) => !["device", "arithmetic", "storage", "q", "status"].includes(field) || new Set(rows.map((row) => row[field])).size > 1);

  const options = (id, field, all) => {
    const values = [...new Set(rows.map((row) => row[field]))];
    const list = all && values.length > 1 ? [["", all], ...values.map((v) => [v, v])] : values.map((v) => [v, v]);
    for (const [value, label] of list) element(id).append(new Option(label, value));
    element(id).closest("label").hidden = values.length < 2;
  };

  // A word must be in the row, a word after a minus must not.
  const matches = (row, words) => words.every((word) => word.startsWith("-") && word.length > 1
    ? !row.text.includes(word.slice(1)) : row.text.includes(word));
  const number = (row, field) => {
    const value = row[field];
    return value === "never" ? Infinity : field === "lanes" ? Number(value) : value;
  };
  const order = (a, b) => {
    const [x, y] = [number(a, sorted.column), number(b, sorted.column)];
    if (x === null || y === null) return (x === null) - (y === null); // the unknown comes last either way
    const less = typeof x === "string" ? x.localeCompare(y) : x === y ? 0 : x - y;
    return sorted.up ? less : -less;
  };

  // Rows come in the order in which cases happened to end.
  const questions = [...new Set(rows.map((row) => row.q))];
  const soon = (row) => (typeof row.t1 === "number" && !row.unknown.includes("t1") ? row.t1 : Infinity);
  const sooner = (a, b) => questions.indexOf(a.q) - questions.indexOf(b.q) || (soon(a) === soon(b) ? 0 : soon(a) - soon(b));
  rows.sort(sooner);

  function choose() {
    const words = element("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const device = element("device").value;
    chosen = rows.filter((row) => (!device || row.device === device) && matches(row, words));
    sort();
    draw();
  }
  function sort() {
    if (sorted.column) chosen.sort(order);
    place = 0;
    fill();
  }
  function fill() {
    const body = document.createDocumentFragment();
    for (const row of chosen.slice(place, place + PAGE)) {
      const line = document.createElement("tr");
      for (const [, , show, text] of columns) {
        const cell = document.createElement("td");
        cell.textContent = show(row);
        if (text) { cell.className = "text"; cell.title = cell.textContent; }
        line.append(cell);
      }
      if (row.status !== "ok") { line.lastChild.classList.add("bad"); line.title = row.reason; }
      body.append(line);
    }
    element("body").replaceChildren(body);
    const last = Math.min(place + PAGE, chosen.length);
    element("place").textContent = chosen.length ? `${place + 1} to ${last} of ${chosen.length}` : "no case matches";
    element("pages").hidden = chosen.length > 0 && chosen.length <= PAGE;
    element("before").disabled = place === 0;
    element("after").disabled = last === chosen.length;
    for (const cell of element("head").children) {
      cell.setAttribute("aria-sort", cell.dataset.field === sorted.column ? (sorted.up ? "ascending" : "descending") : "none");
    }
  }

  // A case that another of its device starts no later than, with no more bias and variance x time, is never the best.
  function undominated(some) {
    const kept = [];
    for (const row of [...some].sort((a, b) => a.t - b.t || a.b - b.b || a.vt - b.vt)) {
      if (!kept.some((one) => one.device === row.device && one.b <= row.b && one.vt <= row.vt)) kept.push(row);
    }
    return kept;
  }
  function shown(name) {
    const question = element("question").value;
    if (name === "confirm") {
      const cases = new Set(chosen.map((row) => row.case + row.device));
      return data.confirmed.filter((row) => row.q === question && cases.has(row.case + row.device));
    }
    const some = chosen.filter((row) => row.q === question && row.v !== null);
    if (name === "pareto") return undominated(some);
    if (some.length <= MOST || (name !== "cost" && name !== "devices")) return some;
    return some.sort((a, b) => (soon(a) === soon(b) ? 0 : soon(a) - soon(b))).slice(0, MOST);
  }
  function theme(values) {
    const wide = Math.max(...values.map((row) => row.colour.length)) > 18;
    const dark = matchMedia("(prefers-color-scheme: dark)").matches, phone = innerWidth < 640;
    const [ink, soft, line] = dark ? ["#e6e7ea", "#a0a5b0", "#343841"] : ["#1c1e21", "#667", "#e2e4e8"];
    return {
      background: "transparent", font: "system-ui, sans-serif", view: { stroke: line },
      axis: { labelColor: ink, titleColor: ink, gridColor: line, domainColor: soft, tickColor: soft, titleFontWeight: "normal",
        labelFontSize: phone ? 10 : 11 },
      legend: { labelColor: ink, titleColor: ink, labelLimit: phone ? (wide ? 280 : 130) : 200, orient: phone ? "bottom" : "right",
        columns: phone && !wide ? 2 : 1, layout: { bottom: { direction: "vertical", anchor: "start" } }, symbolStrokeWidth: 2, titleFontWeight: "normal", symbolLimit: 60,
        symbolBaseFillColor: soft, symbolBaseStrokeColor: soft },
    };
  }
  const used = (values) => new Set(values.map((row) => row.colour));
  // Trackers that no row of the question has are no help in a legend; colours stay as they are.
  function trimmed(spec, values) {
    const copy = structuredClone(spec), present = used(values);
    const visit = (part) => {
      if (part === null || typeof part !== "object") return;
      if (part.field === "colour" && part.scale && part.legend !== null) {
        part.legend = { ...part.legend, values: part.scale.domain.filter((name) => present.has(name)) };
      }
      Object.values(part).forEach(visit);
    };
    visit(copy);
    return copy;
  }
  async function embed(name) {
    const chart = data.charts[name], source = name === "confirm" ? "confirmed" : "rows";
    const values = shown(name), figure = element(`figure-${name}`);
    const total = name === "confirm" ? values.length : chosen.filter((row) => row.q === element("question").value && row.v !== null).length;
    figure.querySelector("figcaption").textContent = values.length < total && name !== "pareto"
      ? `The ${values.length} cases of ${total} that reach 1 % soonest; filter to see others.` : "";
    views[name]?.finalize();
    if (!values.length) {
      delete views[name];
      figure.querySelector(".chart").replaceChildren();
      figure.querySelector("figcaption").textContent = "No case matches.";
      return;
    }
    const spec = { ...trimmed(chart.spec, values), config: theme(values), datasets: { [source]: values }, autosize: { type: "fit-x", contains: "padding" } };
    const rowed = { occupancy: "colour", devices: "method" }[name];
    if (rowed) spec.height = 22 * Math.max(1, new Set(values.map((row) => row[rowed])).size);
    views[name] = await vegaEmbed(figure.querySelector(".chart"), spec, { actions: false, renderer: "canvas" });
  }
  function picture(address, text) {
    const image = new Image();
    image.src = address;
    image.alt = text;
    image.title = text;
    return image;
  }
  function caption(text) {
    const line = document.createElement("figcaption");
    line.textContent = text;
    return line;
  }
  function render() {
    const question = element("question").value, ids = new Set(chosen.map((row) => row.id));
    const panels = data.renders.filter((one) => one.q === question)
      .map((one) => ({ ...one, items: one.items.filter((item) => ids.has(item.id)) }))
      .filter((one) => one.items.length);
    element("renders").hidden = !panels.length;
    const body = document.createDocumentFragment();
    for (const one of panels) {
      const grid = document.createElement("div"), several = data.renders.some((other) => other.device !== one.device);
      grid.className = "renders";
      const reference = { method: "what it should be", picture: one.reference };
      for (const item of [reference, ...one.items]) {
        const figure = document.createElement("figure"), title = document.createElement("h3"), pair = document.createElement("div");
        title.textContent = item.method;
        pair.className = "pair";
        pair.append(picture(item.picture, item.method));
        figure.append(title, pair);
        if (item.error) {
          pair.append(picture(item.error, `error of ${item.method}`));
          figure.append(caption(`${item.samples} samples, ${seconds(item.time)} a pixel; relative RMSE ${percent(item.rmse)}`));
        } else {
          const scale = document.createElement("div");
          scale.className = "scale";
          figure.append(caption(`The mean of all unbiased cases${several ? `, ${one.device}` : ""}. Errors: 0 to ${percent(one.brightest)} of its mean`), scale);
        }
        grid.append(figure);
      }
      body.append(grid);
    }
    element("renders-hint").textContent = "Each case had the same device time; beside each picture its error, " +
      "the brighter the larger. The exposure and the scale of errors are the same for all.";
    element("renders-body").replaceChildren(body);
  }
  const visible = new Set(), stale = new Set();
  let drawing = Promise.resolve();
  function refresh(name) {
    if (!visible.has(name) || !stale.has(name) || !window.vegaEmbed) return;
    stale.delete(name);
    // between two charts the browser may show the first, and answer
    drawing = drawing.then(() => new Promise((resolve) => setTimeout(resolve))).then(() => embed(name))
      .catch((error) => console.error(error));
  }
  function draw() {
    const question = element("question").value;
    const count = chosen.filter((row) => row.q === question).length;
    element("count").textContent = `${count} cases of this question, ${chosen.length} in all`;
    for (const name of Object.keys(data.charts)) { stale.add(name); refresh(name); }
    render();
  }
  window.freepathReady = () => drawing;

  function later(action, milliseconds) {
    let timer;
    return () => { clearTimeout(timer); timer = setTimeout(action, milliseconds); };
  }
  options("question", "q");
  options("device", "device", "all");
  element("about").textContent = [...new Set(rows.map((row) => row.device))].join(" | ");
  for (const [label, field, , text] of columns) {
    const cell = document.createElement("th"), button = document.createElement("button");
    button.textContent = label;
    button.type = "button";
    cell.dataset.field = field;
    cell.scope = "col";
    if (text) cell.className = "text";
    cell.append(button);
    cell.addEventListener("click", () => {
      sorted = { column: field, up: sorted.column === field ? !sorted.up : true };
      sort();
    });
    element("head").append(cell);
  }
  for (const [name, chart] of Object.entries(data.charts)) {
    const figure = document.createElement("figure"), title = document.createElement("h2");
    const box = document.createElement("div"), caption = document.createElement("figcaption");
    figure.id = `figure-${name}`;
    title.textContent = chart.title;
    box.className = "chart";
    figure.append(title, box, caption);
    element("charts").append(figure);
  }
  const watcher = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const name = target.id.slice("figure-".length);
      if (isIntersecting) { visible.add(name); refresh(name); } else visible.delete(name);
    }
  }, { rootMargin: "300px" });
  for (const name of Object.keys(data.charts)) watcher.observe(element(`figure-${name}`));
  element("before").addEventListener("click", () => { place -= PAGE; fill(); });
  element("after").addEventListener("click", () => { place += PAGE; fill(); });
  element("filter").addEventListener("input", later(choose, 150));
  element("question").addEventListener("change", draw);
  element("device").addEventListener("change", choose);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  let width = innerWidth;
  addEventListener("resize", later(() => { if (innerWidth !== width) { width = innerWidth; draw(); } }, 250));
  choose();
  window.freepathStart = () => Object.keys(data.charts).forEach(refresh);
})();
