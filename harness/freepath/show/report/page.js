"use strict";
// All text goes into the page as textContent, so a name is never markup.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const rows = data.rows.map((cells) => Object.fromEntries(cells.map((cell, i) => [data.fields[i], cell])));
  const element = (id) => document.getElementById(id);
  const MOST = 80, PAGE = 50;
  const HUES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#111111"], GREY = "#9a9ea6";
  const TIMES = { t10: "10 %", t1: "1 %", t01: "0.1 %" };
  const views = {}, worn = {};
  // what a link holds: the accuracy of the cards, the column, and the tracker or case that is isolated
  let sorted = { column: "t1", up: true }, place = 0, chosen = [], accuracy = "t1", isolated = null;

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
  const accurately = (value) => value === null ? "" : value >= 1e4 ? "over 1000000 %" : `${Number((100 * value).toPrecision(3))} %`;
  // The answer's columns come first, so that a phone shows them too.
  const all = [
    ["case", "method", (row) => row.method, true],
    ...Object.entries(TIMES).map(([field, name]) => ["to " + name, field, (row) => until(row, field)]),
    ["x baseline", "xb", (row) => row.xb ?? ""], ["bias (RMS)", "bias", (row) => row.bias_told],
    ["time", "t", (row) => seconds(row.t)], ["lookups", "lookups", (row) => short(row.lookups)],
    ["rel. var.", "v", (row) => short(row.v)], ["occ.", "occupancy", (row) => percent(row.occupancy)],
    ["lanes", "lanes", (row) => row.lanes], ["arithmetic", "arithmetic", (row) => row.arithmetic, true],
    ["storage", "storage", (row) => row.storage, true],
    ["device", "device", (row) => row.device, true], ["status", "status", (row) => row.status, true],
  ];
  const SAME = ["lanes", "arithmetic", "storage", "device", "status"];
  const columns = all.filter(([, field]) => !SAME.includes(field) || new Set(rows.map((row) => row[field])).size > 1);
  const alike = SAME.filter((field) => field !== "device" && field !== "status" && rows[0][field] && !columns.some((one) => one[1] === field));
  const terms = { ...data.terms, xb: "how many times as fast as the baseline at 1 %", method: "tracker, majorant and tightness" };

  const options = (id, field, all) => {
    const values = field === "q" ? questions : [...new Set(rows.map((row) => row[field]))];
    const list = all && values.length > 1 ? [["", all], ...values.map((v) => [v, v])] : values.map((v) => [v, v]);
    for (const [value, label] of list) element(id).append(new Option(label, value));
    element(id).closest("label").hidden = values.length < 2;
  };

  // A word must be in the row, a word after a minus must not.
  const matches = (row, words) => words.every((word) => word.startsWith("-") && word.length > 1
    ? !row.text.includes(word.slice(1)) : row.text.includes(word));
  const number = (row, field) => {
    const value = row[field];
    return value === "never" ? Infinity : ["lanes", "xb"].includes(field) && value !== null ? Number(value) : value;
  };
  const order = (a, b) => {
    const unsure = (row) => row.unknown.includes(sorted.column) || row[sorted.column] === null;
    if (unsure(a) !== unsure(b)) return unsure(a) - unsure(b);
    const [x, y] = [number(a, sorted.column), number(b, sorted.column)];
    if (x === null || y === null) return (x === null) - (y === null); // the unknown comes last either way
    const less = typeof x === "string" ? x.localeCompare(y) : x === y ? 0 : x - y;
    return sorted.up ? less : -less;
  };

  // The question with the most at stake first, and in it the fastest.
  const questions = [...new Set(data.answers.map((one) => one.q))];
  const soon = (row) => (typeof row.t1 === "number" && !row.unknown.includes("t1") ? row.t1 : Infinity);
  const sooner = (a, b) => soon(a) === soon(b) ? 0 : soon(a) - soon(b);
  rows.sort(sooner);
  const asked = () => element("question").value;

  let narrowed = [];
  function choose() {
    const words = element("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const device = element("device").value;
    narrowed = rows.filter((row) => (!device || row.device === device) && matches(row, words));
    sort();
    answer();
    draw();
  }
  function sort() {
    chosen = narrowed.filter((row) => row.q === asked());
    if (sorted.column) chosen.sort(order);
    place = 0;
    fill();
    remember();
  }
  function remember() {
    const state = { q: asked(), device: element("device").value, filter: element("filter").value, at: accuracy,
      sort: sorted.column, down: sorted.up ? "" : "1", ...(isolated && { [isolated.field === "id" ? "case" : "tracker"]: isolated.field === "id" ? isolated.name : isolated.value }) };
    const told = new URLSearchParams(Object.entries(state).filter(([, value]) => value));
    if (location.hash.slice(1) !== String(told)) history.replaceState(null, "", "#" + told);
  }
  function recall() {
    const state = new URLSearchParams(location.hash.slice(1)), has = (id, value) => [...element(id).options].some((one) => one.value === value);
    for (const [id, name] of [["question", "q"], ["device", "device"]]) if (has(id, state.get(name))) element(id).value = state.get(name);
    element("filter").value = state.get("filter") ?? "";
    accuracy = state.get("at") in TIMES ? state.get("at") : "t1";
    sorted = { column: columns.some((one) => one[1] === state.get("sort")) ? state.get("sort") : accuracy, up: !state.get("down") };
    const one = rows.find((row) => row.q === asked() && row.case + " " + row.device === state.get("case"));
    isolated = one ? { field: "id", value: one.id, name: state.get("case") } : state.get("tracker") ? { field: "colour", value: state.get("tracker") } : null;
  }
  const matchesIsolated = (row) => !isolated || row[isolated.field] === isolated.value;
  function isolate(field, value) {
    const row = rows.find((one) => one[field] === value);
    isolated = !row || (isolated && isolated.field === field && isolated.value === value) ? null : { field, value, name: `${row.case} ${row.device}` };
    fill();
    remember();
    draw();
  }
  function make(tag, text, name = "") {
    const one = document.createElement(tag);
    one.textContent = text;
    if (name) one.className = name;
    return one;
  }
  // Sentences and ratios are those of the terminal and of Markdown: Python made them.
  function answer() {
    const body = document.createDocumentFragment(), device = element("device").value;
    const found = data.answers.filter((one) => one.q === asked() && (!device || one.device === device));
    for (const one of found) {
      if (found.length > 1) body.append(make("h2", one.device));
      body.append(make("p", one.cards[accuracy].sentence, "sentence"));
      const cards = make("div", "", "cards");
      for (const [field, name] of Object.entries(TIMES)) {
        const card = make("button", "", "card"), told = one.cards[field];
        card.type = "button";
        card.setAttribute("aria-pressed", field === accuracy);
        card.append(make("small", `fastest to ${name}`));
        if (told.id === null) card.append(make("span", told.sentence.replace(/^At [^:]*: /, "")));
        else {
          card.append(make("strong", told.time), make("b", told.name), make("span", told.ratio || "the baseline itself"));
          if (told.ratio) card.append(make("small", `baseline: ${told.base}`));
          card.append(make("small", told.bias + (told.close ? `; not significantly slower: ${told.close} more` : "")));
        }
        card.addEventListener("click", () => { accuracy = field; sorted = { column: field, up: true }; sort(); answer(); });
        cards.append(card);
      }
      body.append(cards);
    }
    element("answers").replaceChildren(body);
  }
  function fill() {
    const body = document.createDocumentFragment();
    for (const row of chosen.slice(place, place + PAGE)) {
      const line = document.createElement("tr");
      line.addEventListener("click", () => isolate("id", row.id));
      if (isolated) line.setAttribute("aria-selected", matchesIsolated(row));
      for (const [, field, show, text] of columns) {
        const cell = document.createElement("td");
        cell.textContent = show(row);
        if (field === sorted.column) cell.classList.add("key");
        if (field === "method") {
          const button = make("button", show(row));
          button.type = "button";
          cell.replaceChildren(button);
        }
        if (text) { cell.classList.add("text"); cell.title = cell.textContent; }
        line.append(cell);
      }
      if (row.status !== "ok") { line.lastChild.classList.add("bad"); line.title = row.reason; }
      body.append(line);
    }
    element("body").replaceChildren(body);
    const last = Math.min(place + PAGE, chosen.length);
    element("place").textContent = chosen.length ? `${place + 1} to ${last} of ${chosen.length}` : "no case matches";
    element("all").hidden = !isolated;
    element("all").textContent = isolated ? `Show all, not only ${isolated.field === "id" ? rows.find((row) => row.id === isolated.value).method : isolated.value}` : "";
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
    const question = asked();
    if (name === "confirm") {
      const cases = new Set(chosen.map((row) => row.case + row.device));
      return data.confirmed.filter((row) => row.q === question && cases.has(row.case + row.device));
    }
    const some = chosen.filter((row) => row.v !== null).sort(sooner);
    if (name === "pareto") return undominated(some);
    if (some.length <= MOST || (name !== "cost" && name !== "devices")) return some;
    return some.slice(0, MOST);
  }
  const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;
  function theme() {
    const phone = innerWidth < 640;
    const [ink, soft, line] = dark() ? ["#e6e7ea", "#a0a5b0", "#343841"] : ["#1c1e21", "#667", "#d9dce1"];
    return {
      background: "transparent", font: "system-ui, sans-serif", view: { stroke: line },
      axis: { labelColor: ink, titleColor: ink, gridColor: line, domainColor: soft, tickColor: soft, titleFontWeight: "normal",
        labelFontSize: phone ? 10 : 11 },
      legend: { labelColor: ink, titleColor: ink, labelLimit: 200, columns: phone ? 2 : 4, symbolStrokeWidth: 2, titleFontWeight: "normal",
        symbolLimit: 30, symbolBaseFillColor: soft, symbolBaseStrokeColor: soft },
    };
  }
  // The baseline and the six trackers that reach 1 % first have colours; one that has worn a colour keeps it if it can.
  function hues(some) {
    const bases = data.answers.filter((one) => one.q === asked()).map((one) => one.cards.t1.base_id);
    const base = some.filter((row) => bases.includes(row.id)).map((row) => row.colour).slice(0, 1), taken = {};
    const first = [...new Set([...base, ...some.map((row) => row.colour)])].slice(0, HUES.length);
    for (const name of first) if (worn[name] && !Object.values(taken).includes(worn[name])) taken[name] = worn[name];
    for (const name of first) taken[name] ??= HUES.find((one) => !Object.values(taken).includes(one));
    Object.assign(worn, taken);
    return taken;
  }
  // Colours and the legends' values of what is shown, and the page's own ink.
  function dressed(spec, values) {
    const copy = structuredClone(spec), some = chosen.filter((row) => row.v !== null).sort(sooner), taken = hues(some), phone = innerWidth < 640;
    const visit = (part) => {
      if (part === null || typeof part !== "object") return;
      if (phone && part.orient === "bottom" && part.columns > 1) part.columns = 2;
      if (phone && part.type === "text") part.limit = 92;
      if (part.field === "time" && part.scale) part.scale.domain = [values[0].lo, values[0].hi];
      if (part.field === "colour" && part.scale?.range) part.scale.range = part.scale.domain.map((name) => taken[name] ?? GREY);
      Object.values(part).forEach(visit);
    };
    visit(copy);
    const leads = {};
    for (const row of some) if (taken[row.colour] && matchesIsolated(row)) leads[row.colour] ??= row.id;
    const told = values.map((row) => ({ ...row, faded: !matchesIsolated(row),
      lead: isolated?.field === "id" && row.id === isolated.value ? row.method : leads[row.colour] === row.id ? row.colour : null }));
    return [JSON.parse(JSON.stringify(copy).replaceAll("#111111", dark() ? "#f2f2f2" : "#111111")), told];
  }
  // One notation for a number: the tooltip's are the table's.
  function tip(_, event, item) {
    const box = element("tip"), datum = item?.datum, row = datum && datum.id !== undefined && rows.find((one) => one.id === datum.id);
    box.hidden = !row || !["symbol", "rule", "rect"].includes(item.mark.marktype);
    if (box.hidden) return;
    const lines = [make("b", row.method)], devices = new Set(rows.map((one) => one.device)).size > 1;
    const add = (name, text) => { if (text) lines.push(make("div", `${name}: ${text}`)); };
    if (devices) add("device", row.device);
    if (datum.ratio !== undefined) {
      add("samples per ray", short(datum.samples));
      add("predicted RMSE", accurately(datum.predicted));
      add("measured / predicted", short(datum.ratio));
    } else {
      if (datum.seconds) add(`to ${datum.error}`, seconds(datum.seconds));
      else if (datum.time) add(`after ${seconds(datum.time)}`, `RMSE ${datum.width === undefined && datum.error <= 1e-4 ? "below " : datum.width === undefined && datum.error >= 10 ? "above " : ""}${accurately(datum.error)}${datum.width ? ` ± ${accurately(datum.width)} of it` : ""}`);
      add("to 1 %", until(row, "t1"));
      add("time per sample", seconds(row.t));
      add("lookups per sample", short(row.lookups));
      add("relative variance", short(row.v));
    }
    box.replaceChildren(...lines);
    const wide = box.offsetWidth, x = event.clientX + 18, right = x + wide > innerWidth - 4;
    box.style.left = `${Math.max(4, right ? event.clientX - wide - 18 : x)}px`;
    box.style.top = `${Math.max(4, Math.min(innerHeight - box.offsetHeight - 4, event.clientY + 18))}px`;
  }
  // Vega-Lite lets the pointer find only the layer that has the selection; labels and marks at the edge count too.
  function touchable(part) {
    for (const mark of part.marks ?? []) {
      if (["text", "symbol"].includes(mark.type)) mark.interactive = true;
      touchable(mark);
    }
    return part;
  }
  function save(name, address) {
    const link = document.createElement("a");
    link.download = name;
    link.href = address;
    link.click();
  }
  async function picture_of(name, kind) {
    if (!views[name]) return;
    const view = views[name].view, before = view.background();
    await view.background(getComputedStyle(document.body).backgroundColor).runAsync();
    save(`${name}.${kind}`, await view.toImageURL(kind, 2));
    await view.background(before).runAsync();
  }
  function table() {
    const quoted = (text) => (/[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const cells = [columns.map(([label]) => label), ...chosen.map((row) => columns.map(([, field, show, text]) => text ? show(row) :
      Object.keys(TIMES).includes(field) && row.unknown.includes(field) ? "" : row[field] ?? ""))];
    return cells.map((line) => line.map((one) => quoted(String(one))).join(",")).join("\r\n") + "\r\n";
  }
  async function embed(name) {
    const chart = data.charts[name], source = name === "confirm" ? "confirmed" : "rows";
    const values = shown(name), figure = element(`figure-${name}`);
    const total = name === "confirm" ? values.length : chosen.filter((row) => row.v !== null).length;
    figure.querySelector("figcaption").textContent = values.length < total && name !== "pareto"
      ? `The ${values.length} cases of ${total} that reach 1 % first; filter to see others.` : "";
    views[name]?.finalize();
    if (!values.length) {
      delete views[name];
      figure.querySelector(".chart").replaceChildren();
      figure.querySelector("figcaption").textContent = "No case matches.";
      return;
    }
    const [plain, told] = dressed(chart.spec, values);
    const spec = { ...plain, config: theme(), datasets: { ...plain.datasets, [source]: told }, autosize: { type: "fit-x", contains: "padding" } };
    const rowed = { occupancy: "colour", devices: "method" }[name];
    if (rowed) spec.height = 22 * Math.max(1, new Set(values.map((row) => row[rowed])).size);
    views[name] = await vegaEmbed(figure.querySelector(".chart"), spec, { actions: false, renderer: "canvas", tooltip: tip, patch: touchable, logLevel: 1 }); // no word of labels that are none
    views[name].view.addEventListener("click", (event, item) => {
      if (item?.datum?.id === undefined) return;
      if (item.mark.marktype === "text") isolate("colour", item.datum.colour); else isolate("id", item.datum.id);
    });
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
    const question = element("question").value, ids = new Set(chosen.map((row) => row.id)), uneven = [];
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
        pair.addEventListener("click", () => wipe([reference, ...one.items], item));
        if (item.error) {
          pair.append(picture(item.error, `error of ${item.method}`));
          figure.append(caption(`${item.samples} samples, ${seconds(item.time)} a pixel; relative RMSE ${accurately(item.rmse)}`));
        } else {
          const scale = document.createElement("div");
          scale.className = "scale";
          figure.append(caption(`The mean of all unbiased cases${several ? `, ${one.device}` : ""}. Errors: 0 to ${accurately(one.brightest)} of its mean`), scale);
        }
        grid.append(figure);
      }
      body.append(grid);
    }
    for (const one of panels) {
      const times = one.items.map((item) => item.time), [low, high] = [Math.min(...times), Math.max(...times)];
      if (high > 1.05 * low) uneven.push(`${seconds(low)} to ${seconds(high)} a pixel, a factor of ${short(high / low)}`);
    }
    element("renders-hint").textContent = (uneven.length ? `Device times differ: ${uneven.join("; ")}. ` : "Each case had the same device time, within 5 %. ") +
      "The least error first; beside each picture its error, the brighter the larger. The exposure and the scale of errors are the same for all. Click to enlarge and compare two.";
    element("renders-body").replaceChildren(body);
  }
  function wipe(items, right) {
    const show = () => {
      element("under").src = items[element("right").value].picture;
      element("over").src = items[element("left").value].picture;
      element("over").style.clipPath = `inset(0 ${100 - element("edge").value}% 0 0)`;
      element("stack").style.setProperty("--edge", `${element("edge").value}%`);
    };
    for (const id of ["left", "right"]) {
      element(id).replaceChildren(...items.map((item, i) => new Option(item.method, i)));
      element(id).onchange = show;
    }
    element("right").value = Math.max(items.indexOf(right), items.length > 1 ? 1 : 0);
    element("edge").oninput = show;
    element("stack").onpointermove = (event) => {
      const box = element("stack").getBoundingClientRect();
      element("edge").value = 100 * (event.clientX - box.left) / box.width;
      show();
    };
    show();
    element("wipe").showModal();
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
    const all = rows.filter((row) => row.q === asked()).length, others = narrowed.length - chosen.length;
    element("count").textContent = `${chosen.length} of ${all} cases` + (others && questions.length > 1 && narrowed.length < rows.length ? `; ${others} of other questions match` : "");
    element("tip").hidden = true;
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
    if (terms[field]) {
      button.title = terms[field];
      button.setAttribute("aria-describedby", `term-${field}`);
      const meaning = make("dd", terms[field]);
      meaning.id = `term-${field}`;
      element("terms").append(make("dt", label), meaning);
    }
    cell.append(button);
    cell.addEventListener("click", () => {
      sorted = { column: field, up: sorted.column === field ? !sorted.up : true };
      if (field in TIMES) accuracy = field;
      sort();
      answer();
    });
    element("head").append(cell);
  }
  for (const [name, chart] of Object.entries(data.charts)) {
    const figure = document.createElement("figure"), title = document.createElement("h2");
    const box = document.createElement("div"), caption = document.createElement("figcaption");
    figure.id = `figure-${name}`;
    title.textContent = chart.title;
    box.className = "chart";
    box.setAttribute("role", "img");
    box.setAttribute("aria-label", `Chart: ${chart.title}; the table below holds its numbers`);
    const saving = make("span", "", "saving");
    for (const kind of ["svg", "png"]) {
      const button = make("button", kind.toUpperCase());
      button.type = "button";
      button.setAttribute("aria-label", `Save the chart "${chart.title}" as ${kind.toUpperCase()}`);
      button.addEventListener("click", () => picture_of(name, kind));
      saving.append(button);
    }
    title.append(saving);
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
  element("question").addEventListener("change", () => { isolated = null; choose(); });
  element("all").addEventListener("click", () => { isolated = null; fill(); remember(); draw(); });
  element("csv").addEventListener("click", () => {
    const address = URL.createObjectURL(new Blob([table()], { type: "text/csv" }));
    save("cases.csv", address);
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  });
  addEventListener("hashchange", () => { recall(); choose(); });
  addEventListener("scroll", () => { element("tip").hidden = true; }, { passive: true });
  element("device").addEventListener("change", choose);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  let width = innerWidth;
  addEventListener("resize", later(() => { if (innerWidth !== width) { width = innerWidth; draw(); } }, 250));
  element("alike").textContent = alike.map((field) => `${field}: ${rows[0][field]}`).join("; ");
  recall();
  choose();
  window.freepathStart = () => Object.keys(data.charts).forEach(refresh);
})();
