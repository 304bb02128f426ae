// The interactive part of a report: fills figures made with Bokeh from the arrays of the page.
// All text from the archive is set as text, never as markup; nothing is fetched.
"use strict";
(async () => {
  const $ = (id) => document.getElementById(id);
  const about = JSON.parse($("description").textContent);
  const parts = JSON.parse($("figures").textContent);
  const blockBytes = Uint8Array.from(atob($("block").textContent), (letter) => letter.charCodeAt(0));
  const inflated = new Blob([blockBytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(inflated).arrayBuffer());

  // Arrays of the block. 32-bit floats are stored by bytes of equal weight.
  const KINDS = { f8: Float64Array, u2: Uint16Array, i1: Int8Array, i4: Int32Array, f4: Float32Array };
  function array({ type, at, n }) {
    const size = KINDS[type].BYTES_PER_ELEMENT;
    const raw = bytes.slice(at, at + n * size);
    if (type !== "f4") return new KINDS[type](raw.buffer);
    const ordered = new Uint8Array(n * size);
    for (let k = 0; k < size; k++) for (let i = 0; i < n; i++) ordered[size * i + k] = raw[k * n + i];
    return new Float32Array(ordered.buffer);
  }
  function curve(entry, factor) { // differences of 16-bit levels; level 0 is a missing value
    let level = 0;
    return Array.from(array(entry), (step) => {
      level = (level + step) & 0xffff;
      return level === 0 ? NaN : factor * (entry.low + (level - 1) / 65534 * (entry.high - entry.low));
    });
  }

  const dims = about.dims, shape = dims.map((dim) => dim.texts.length);
  const status = array(about.status), exact = array(about.exact);
  const metrics = new Map(about.metrics.map((metric) => [metric.name, { ...metric, values: array(metric) }]));
  const numberOf = (place) => place.reduce((sum, k, axis) => sum * shape[axis] + k, 0);
  function placeOf(number) {
    const place = shape.map(() => 0);
    for (let axis = shape.length - 1; axis >= 0; axis--) {
      place[axis] = number % shape[axis];
      number = Math.floor(number / shape[axis]);
    }
    return place;
  }
  const moved = (place, changes) => place.map((k, axis) => changes[axis] ?? k);
  let place = placeOf(about.start);
  const placesAlong = (axes) => axes.reduce( // the selected place with every combination of values of some axes
    (list, axis) => list.flatMap((at) => dims[axis].texts.map((_, k) => moved(at, { [axis]: k }))), [place]);

  for (const [name, item] of Object.entries(parts)) await Bokeh.embed.embed_item(item, `figure-${name}`);
  const named = new Map();
  function model(name) { // models are looked up once; null where the page has no such part
    if (!named.has(name)) {
      const first = Bokeh.documents.map((document) => document.get_model_by_name(name)).find((one) => one != null);
      named.set(name, first ?? null);
    }
    return named.get(name);
  }
  const fill = (name, data) => { model(name).data = data; };

  function short(value) {
    if (value === 0) return "0";
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    return size >= 0.01 && size < 1e4 ? String(Number(value.toPrecision(3))) : value.toExponential(1);
  }
  function say(id, text) { if ($(id)) $(id).textContent = text; }
  const unitOf = (thing) => (thing.unit ? ` ${thing.unit}` : "");
  const valueOf = (metric, number) => metric.values[number] * metric.factor;
  const written = (metric, value) => metric.words ? metric.words[value] ?? "–" : short(value) + unitOf(metric);

  // The case that is selected.
  function labels(at) {
    const varied = dims.map((dim, axis) => (shape[axis] > 1 ? `${dim.title} ${dim.texts[at[axis]]}${unitOf(dim)}` : ""));
    return varied.filter(Boolean).join(", ") || "the only case";
  }
  function selection(at) { // what selects the case in Python
    const by = (labelled) => dims.filter((dim) => dim.by_label === labelled);
    const chosen = (dim) => dim.selectors[at[dims.indexOf(dim)]];
    const call = (name, list) => (list.length ? `.${name}(${list.map(chosen).join(", ")})` : "");
    return `open_archive(${about.archive})${call("sel", by(true))}${call("isel", by(false))}`;
  }
  function drawCurves(source, number) {
    const cases = about.cases, entry = cases.entries[number], data = { t: [] };
    for (const history of cases.histories) data[history.name] = [];
    if (entry) {
      data.t = times;
      cases.histories.forEach((history, k) => { data[history.name] = curve(entry.curves[k], history.factor); });
    }
    fill(source, data);
    return entry;
  }
  const times = about.cases?.t ? Array.from(array(about.cases.t)) : [];
  function drawCase() {
    const number = numberOf(place), entry = about.cases?.entries[number];
    const name = about.statuses[status[number]];
    say("case-labels", labels(place));
    say("case-status", name === "ok" ? "" : `This case is ${name}${entry?.message ? `: ${entry.message}` : "."}`);
    say("case-command", selection(place));
    const rows = [...metrics.values()].map((metric) => [metric, valueOf(metric, number)]);
    $("case-metrics").replaceChildren(...rows.filter(([, value]) => Number.isFinite(value)).map(([metric, value]) => {
      const row = document.createElement("tr");
      for (const text of [metric.title, written(metric, value), metric.about]) row.insertCell().textContent = text;
      return row;
    }));
    if (!model("chosen")) return;
    drawCurves("chosen", number);
    const partner = exact[number], drawn = drawCurves("exact", partner === number ? -1 : partner);
    const span = [times[0], times[times.length - 1]];
    showTimes(span, entry?.frequency);
    const lengths = about.cases.histories.find((history) => history.name === "displacement");
    const gap = entry?.gap ?? about.cases.entries[partner]?.gap;
    const drawGap = lengths && gap != null;
    const casing = entry?.casing ?? about.cases.entries[partner]?.casing;
    const line = casing ? { t: times, gap: curve(casing, lengths.factor) }
      : drawGap ? { t: span, gap: [gap * lengths.factor, gap * lengths.factor] } : { t: [], gap: [] };
    if (lengths) fill("gap", line);
    const held = Object.keys(about.cases.entries).length;
    const without = `This page holds the histories of ${held} of ${status.length} cases, and not of this one: `
      + "the line below reads them from the archive. ";
    const reference = partner === number ? "This case is the exact solution itself."
      : drawn ? `Exact solution: ${labels(placeOf(partner))}.`
        : "The archive holds no exact case (event_driven) of this scene that ended ok.";
    const thinned = about.cases.thinned ? " Thinned: the least and the largest value of each short interval." : "";
    say("case-exact", (entry ? "" : without) + reference + thinned);
  }

  let window = "";
  function showTimes(span, frequency) { // all, or the last load periods of very many; what the reader has chosen stays
    const periods = (frequency ?? 0) * (span[1] - span[0]), shown = 20;
    const few = periods > 60 && times.length / periods > 6;
    const wanted = [few ? span[1] - shown / frequency : span[0], span[1]];
    say("case-window", few ? `The last ${shown} of ${Math.round(periods)} load periods; the reset tool shows all.` : "");
    if (window === String(wanted)) return;
    window = String(wanted);
    Object.assign(model("time"), { start: wanted[0], end: wanted[1], reset_start: span[0], reset_end: span[1] });
  }

  // The map of two axes.
  const titleOf = (dim) => dim.title + (dim.unit ? ` [${dim.unit}]` : "");
  function sideOf(menu) { // what lies along a side of the map: the cells of a dimension, or a number that is drawn along it
    const [name, k] = model(menu).value.split(":"), axis = dims.findIndex((dim) => dim.name === name);
    return axis < 0 ? null : { axis, title: titleOf(dims[axis]), ...(k ? dims[axis].numbers[k] : {}) };
  }
  const spotOn = (side, at) => (side ? side.values?.[at[side.axis]] ?? at[side.axis] + 0.5 : 0.5);
  const drawnPlaces = (sides) => placesAlong([...new Set(sides.filter(Boolean).map((side) => side.axis))]);
  function ticks(name, texts, pixels, wide) { // as many labels as do not collide
    const room = wide ? 7 * Math.max(...texts.map((text) => text.length)) + 12 : 18;
    const every = Math.max(1, Math.ceil(texts.length * room / Math.max(pixels, 50)));
    const shown = texts.map((text, k) => [k + 0.5, text]).filter((_, k) => k % every === 0);
    const axis = model(name);
    axis.ticker.ticks = shown.map(([at]) => at);
    axis.major_label_overrides = new Map(shown);
  }
  function drawMap() {
    const figure = model("map");
    if (!figure) return;
    const sides = ["across", "up"].map(sideOf), [x, y] = sides.map((side) => side?.axis ?? -1);
    const [nx, ny] = [shape[x], y < 0 || y === x ? 1 : shape[y]];
    const at = (i, j) => numberOf(moved(place, ny > 1 ? { [x]: i, [y]: j } : { [x]: i }));
    const metric = metrics.get(model("metric").value);
    say("map-about", metric ? `${titleOf(metric)}: ${metric.about}. Grey with a cross: not ok.` : "How each case ended.");
    if (sides.some((side) => side?.values)) return drawPoints(figure, sides, metric);
    fill("points", { x: [], y: [], value: [] });
    const shown = new Float32Array(nx * ny), bad = { x: [], y: [] };
    for (let j = 0; j < ny; j++) for (let i = 0; i < nx; i++) {
      const number = at(i, j);
      shown[j * nx + i] = metric ? valueOf(metric, number) : status[number];
      if (status[number] !== 0 && nx * ny <= 2500) { bad.x.push(i + 0.5); bad.y.push(j + 0.5); }
    }
    const scale = colourScale(shown, metric);
    const cells = `cells_${scale.name}`, NDArray = model(cells).data.image[0].constructor; // Bokeh's array with a shape
    fill(cells, { image: [new NDArray(shown, [ny, nx])], x: [0], y: [0], dw: [nx], dh: [ny] });
    fill("bad", metric ? bad : { x: [], y: [] });
    Object.assign(figure.x_range, { start: 0, end: nx });
    Object.assign(figure.y_range, { start: 0, end: ny });
    figure.height = Math.min(470, Math.max(290, 170 + 36 * ny));
    fill("cell", { x: [place[x] + 0.5], y: [(ny > 1 ? place[y] : 0) + 0.5], w: [1], h: [1] });
    model("map_x").axis_label = sides[0].title;
    model("map_y").axis_label = ny > 1 ? sides[1].title : "";
    const width = figure.inner_width ?? 400;
    ticks("map_x", dims[x].texts, width, true);
    ticks("map_y", ny > 1 ? dims[y].texts : [""], figure.inner_height ?? 300, false);
    writeValues(shown, metric, scale, nx, ny, width);
  }
  function drawPoints(figure, sides, metric) { // a point for each case, where its drawn numbers are
    const places = drawnPlaces(sides), numbers = places.map(numberOf);
    const value = numbers.map((number) => (metric ? valueOf(metric, number) : status[number]));
    const scale = colourScale(value, metric), bad = places.filter((_, k) => metric && status[numbers[k]] !== 0);
    model(`image_${scale.name}`).visible = false;
    const [x, y] = sides.map((side) => places.map((at) => spotOn(side, at)));
    fill("points", { x, y, value });
    fill("bad", { x: bad.map((at) => spotOn(sides[0], at)), y: bad.map((at) => spotOn(sides[1], at)) });
    fill("values", { x: [], y: [], text: [], colour: [] });
    figure.height = 420;
    const spans = sides.map((side, k) => {
      const name = "xy"[k], [low, high] = side?.values ? [Math.min(...side.values), Math.max(...side.values)] : [0, side ? shape[side.axis] : 1];
      const margin = side?.values ? 0.04 * (high - low) || 1 : 0, axis = model(`map_${name}`);
      Object.assign(figure[`${name}_range`], { start: low - margin, end: high + margin });
      axis.axis_label = side?.title ?? "";
      if (!side?.values) ticks(`map_${name}`, side ? dims[side.axis].texts : [""], 300, k === 0);
      else axis.ticker.ticks = [0, 1, 2, 3, 4].map((part) => Number((low + part / 4 * (high - low)).toPrecision(3)));
      return high - low + 2 * margin;
    });
    fill("cell", { x: [spotOn(sides[0], place)], y: [spotOn(sides[1], place)], w: [0.03 * spans[0]], h: [0.04 * spans[1]] });
  }
  function colourScale(shown, metric) { // logarithmic where values are positive and span more than a factor of 30
    let [low, high, least] = [Infinity, -Infinity, Infinity];
    for (const value of shown) if (Number.isFinite(value)) {
      low = Math.min(low, value); high = Math.max(high, value);
      if (value > 0) least = Math.min(least, value);
    }
    const logarithmic = low >= 0 && least < Infinity && high > 30 * least;
    const name = !metric ? "statuses" : metric.words ? "states" : logarithmic ? "log" : "linear";
    const from = logarithmic ? least : low;
    const to = high > from ? high : from + (Math.abs(from) || 1);
    if (name === "log" || name === "linear") Object.assign(model(name), Number.isFinite(from) ? { low: from, high: to } : { low: 0, high: 1 });
    for (const other of ["statuses", "states", "log", "linear"]) {
      for (const part of ["bar", "image", "points"]) model(`${part}_${other}`).visible = other === name;
    }
    const share = (value) => (logarithmic ? Math.log(value / from) / Math.log(to / from) : (value - from) / (to - from));
    return { name, share };
  }
  const inkOn = (share) => (share > 0.5 ? "black" : "white");
  function writeValues(shown, metric, scale, nx, ny, width) { // where there is room for them
    const data = { x: [], y: [], text: [], colour: [] };
    if (metric && !metric.words && width / nx > 48 && ny <= 20) shown.forEach((value, k) => {
      if (!Number.isFinite(value)) return;
      data.x.push(k % nx + 0.5); data.y.push(Math.floor(k / nx) + 0.5);
      data.text.push(short(value)); data.colour.push(inkOn(scale.share(value)));
    });
    fill("values", data);
  }
  function cellAt(event) {
    const sides = ["across", "up"].map(sideOf), [x, y] = sides.map((side) => side?.axis ?? -1);
    if (sides.some((side) => side?.values)) {
      const { x_range, y_range } = model("map"), far = (at) => ((spotOn(sides[0], at) - event.x) / (x_range.end - x_range.start)) ** 2
        + ((spotOn(sides[1], at) - event.y) / (y_range.end - y_range.start)) ** 2;
      return drawnPlaces(sides).reduce((nearest, at) => (far(at) < far(nearest) ? at : nearest));
    }
    const [i, j] = [Math.floor(event.x), Math.floor(event.y)];
    const flat = y < 0 || y === x;
    if (!(i >= 0 && i < shape[x] && j >= 0 && j < (flat ? 1 : shape[y]))) return null;
    return moved(place, flat ? { [x]: i } : { [x]: i, [y]: j });
  }

  // Errors against cost and step: a line through the steps for each scheme, the scene being that of the selected case.
  const error = metrics.get("error"), cost = metrics.get("processor_time");
  const ofScheme = metrics.get("scheme_error") ?? error, ofModel = metrics.get("model_error") ?? error;
  const schemes = about.scheme_dim === null ? [about.scheme] : dims[about.scheme_dim].texts;
  const look = (k) => ({ colour: about.colours[k % about.colours.length], marker: about.markers[k % about.markers.length] });
  function choices() { // places of the selected scene that differ in scheme and step, or in all that is numerical
    const varied = about.h_dim === null ? about.numerical
      : [about.scheme_dim, about.h_dim].filter((axis, k, all) => axis !== null && all.indexOf(axis) === k);
    return placesAlong(varied);
  }
  function drawErrors(name, measure, xOf) {
    if (!model(name)) return;
    const rows = choices().map((at) => {
      const number = numberOf(at);
      const scheme = about.scheme_dim === null ? 0 : at[about.scheme_dim];
      return { number, scheme, h: about.h[at[about.h_dim] ?? 0], x: xOf(number, at), y: measure.values[number] };
    }).filter((row) => Number.isFinite(row.y) && row.x > 0);
    const drawn = rows.filter((row) => row.y > 0);
    const data = { x: [], y: [], colour: [], marker: [], case: [], scheme: [], h: [] };
    for (const row of drawn) {
      const { colour, marker } = look(row.scheme);
      const h = row.h == null ? "" : `${short(row.h)} s`;
      const values = { ...row, colour, marker, h, scheme: schemes[row.scheme], case: row.number };
      for (const key of Object.keys(data)) data[key].push(values[key]);
    }
    fill(`${name}_points`, data);
    const flat = rows.filter((row) => row.y === 0).map((row) => row.x).sort((a, b) => a - b);
    logAxis(name, "x", rows.map((row) => row.x));
    logAxis(name, "y", [...drawn.map((row) => row.y), ...(name === "cost" && drawn.length ? [0.1, 0.001] : [])]);
    const lines = { x: [], y: [], colour: [] }, keys = [];
    schemes.forEach((label, k) => {
      const line = drawn.filter((row) => row.scheme === k).sort((a, b) => a.h - b.h);
      const all = rows.filter((row) => row.scheme === k);
      const isExact = all.length > 0 && line.length === 0;
      if (about.h_dim !== null && line.length > 1) {
        lines.x.push(line.map((row) => row.x)); lines.y.push(line.map((row) => row.y)); lines.colour.push(look(k).colour);
      }
      const exactNote = name === "cost" ? "dotted: no error" : "no error";
      const note = all.length > line.length ? exactNote : all.length === 0 ? "not ok" : name === "order" ? orderOf(line) : "";
      keys.push([label, isExact ? { colour: "#000000", marker: "line" } : look(k), note]);
    });
    fill(`${name}_lines`, lines);
    const middle = name === "cost" && flat.length ? flat[Math.floor(flat.length / 2)] : null;
    fill(`${name}_exact`, middle === null ? { x: [], y: [] } : { x: [[middle, middle]], y: [[1e-30, 1e30]] });
    const here = drawn.filter((row) => row.number === numberOf(place));
    fill(`${name}_here`, { x: here.map((row) => row.x), y: here.map((row) => row.y) });
    writeKey(`${name}-key`, keys);
  }
  function logAxis(name, side, values) { // range and ticks: powers of ten, with 2 and 5 between where these are few
    if (!values.length) return;
    const figure = model(name), [low, high] = [Math.min(...values) / 1.4, Math.max(...values) * 1.4];
    Object.assign(side === "x" ? figure.x_range : figure.y_range, { start: low, end: high });
    const decades = Math.log10(high / low), every = Math.max(1, Math.ceil(decades / 7));
    const ticks = [];
    for (let k = Math.floor(Math.log10(low)); k <= Math.log10(high); k++) {
      for (const first of decades < 2 ? [1, 2, 5] : [1]) {
        if (first * 10 ** k >= low && first * 10 ** k <= high && k % every === 0) ticks.push([first * 10 ** k, `${first}e${k}`]);
      }
    }
    model(`${name}_${side}`).ticker.ticks = ticks.map(([at]) => at);
    model(`${name}_${side}`).major_label_overrides = new Map(ticks);
  }
  function orderOf(line) { // slope of log error over log h by least squares, of errors below a tenth
    const chance = metrics.get("predictability");
    const used = line.filter((row) => row.y < 0.1 && !(row.y <= 10 * (chance?.values[row.number] ?? 0)));
    if (used.length < 3) return "order –";
    const [h, e] = [used.map((row) => Math.log(row.h)), used.map((row) => Math.log(row.y))];
    const mean = (list) => list.reduce((sum, value) => sum + value, 0) / list.length;
    const [mh, me] = [mean(h), mean(e)];
    const slope = h.reduce((sum, one, k) => sum + (one - mh) * (e[k] - me), 0) / h.reduce((sum, one) => sum + (one - mh) ** 2, 0);
    return `order ${(Number(slope.toFixed(2)) + 0).toFixed(2)}`; // no -0.00
  }
  const SIGNS = { circle: "●", square: "■", triangle: "▲", diamond: "◆", inverted_triangle: "▼", plus: "✚", x: "✖", star: "★", line: "┊" };
  function writeKey(id, keys) {
    $(id).replaceChildren(...keys.map(([label, { colour, marker }, note]) => {
      const item = document.createElement("span"), sign = document.createElement("i");
      sign.textContent = SIGNS[marker];
      sign.style.color = colour;
      item.append(sign, ` ${label}${note ? ` (${note})` : ""}`);
      return item;
    }));
  }

  // Errors of the reduced models.
  function drawModes() {
    const figure = model("modes");
    if (!figure) return;
    const sides = ["mechanical_modes", "thermal_modes"].map((name) => about.modes[name]);
    const varied = [...new Set(sides.map((side) => side.dim).filter((axis) => axis !== null))];
    const textAt = (side, at) => side.texts[side.dim === null ? 0 : at[side.dim]];
    const rows = placesAlong(varied).map((at) => ({ number: numberOf(at), counts: sides.map((side) => textAt(side, at)) }));
    const sorted = sides.map((side) => [...new Set(side.texts)].sort((a, b) => (a === "auto" ? Infinity : +a) - (b === "auto" ? Infinity : +b)));
    const data = { x: [], y: [], error: [], text: [], colour: [], name: [] };
    const known = rows.map((row) => ofModel.values[row.number]).filter((value) => value > 0);
    const [low, high] = [Math.min(...known), Math.max(...known)];
    if (known.length) Object.assign(model("modes_colours"), { low, high: high > low ? high : 10 * low });
    const spot = (row) => row.counts.map((text, k) => sorted[k].indexOf(text));
    for (const row of rows) {
      const [x, y] = spot(row), value = ofModel.values[row.number];
      data.x.push(x); data.y.push(y); data.error.push(value === 0 ? low : value);
      data.text.push(Number.isFinite(value) ? short(value) : about.statuses[status[row.number]]);
      data.colour.push(Number.isFinite(value) ? inkOn(Math.log(value / low) / Math.log(high / low)) : "black");
      data.name.push(row.counts.join(" + "));
    }
    fill("modes_points", data);
    const here = spot(rows.find((row) => row.number === numberOf(place)));
    fill("modes_here", { x: [here[0]], y: [here[1]] });
    const chosen = rows.filter((row) => about.chosen_modes && row.counts.every((text, k) => text === about.chosen_modes[k])).map(spot);
    fill("modes_chosen", { x: chosen.map(([x]) => x - 0.33), y: chosen.map(([, y]) => y + 0.3) });
    [figure.x_range, figure.y_range].forEach((range, k) => Object.assign(range, { start: -0.6, end: sorted[k].length - 0.4 }));
    ["modes_x", "modes_y"].forEach((name, k) => {
      model(name).ticker.ticks = sorted[k].map((_, i) => i);
      model(name).major_label_overrides = new Map(sorted[k].map((text, i) => [i, text]));
    });
  }

  // Impulse of the load periods, and what the growth rate of permanent contact predicts for them.
  const ALIKE = 1e-3; // share of the largest by which impulses differ at least for the axis to span their range only
  function drawPeriods() {
    if (!model("periods")) return;
    const entry = about.cases.entries[numberOf(place)];
    const impulse = entry?.periods ? Array.from(array(entry.periods)).filter(Number.isFinite) : [];
    const period = impulse.map((_, k) => k + 1), n = impulse.length;
    fill("period_impulses", { period, impulse });
    const growth = entry?.growth, predicted = { period: [], impulse: [] };
    let text = entry ? "This case has no impulses of load periods." : "The page does not hold the load periods of this case.";
    if (n > 0) text = `${n} load periods.`;
    const [low, high] = [Math.min(...impulse), Math.max(...impulse)], largest = Math.max(Math.abs(low), Math.abs(high));
    if (n > 1 && high > low && high - low < ALIKE * largest) text += ` They differ by ${short((high - low) / largest)} of the largest.`;
    if (n > 1 && growth != null && entry.frequency > 0) {
      const factor = Math.exp(growth / entry.frequency), change = impulse[n - 1] - impulse[n - 2];
      const limit = impulse[n - 1] - change * factor / (factor - 1);
      const margin = 0.3 * (high - low || Math.abs(high));
      period.forEach((k) => {
        const value = factor === 1 ? impulse[n - 1] + (k - n) * change : limit + (impulse[n - 1] - limit) * factor ** (k - n);
        if (value > low - margin && value < high + margin) { predicted.period.push(k); predicted.impulse.push(value); }
      });
      text += ` Dashed: the last two periods extrapolated as if contact were permanent (changes grow ${short(factor)}-fold per period).`;
    }
    fill("predicted", predicted);
    const shown = [...impulse, ...predicted.impulse].filter(Number.isFinite);
    if (shown.length) { // values that are alike are drawn as a level line, not as the rounding between them
      const [least, most] = [Math.min(...shown), Math.max(...shown)];
      const margin = Math.max(0.06 * (most - least), 0.5 * (ALIKE * largest - (most - least))) || 1;
      Object.assign(model("periods").y_range, { start: least - margin, end: most + margin });
    }
    say("periods-about", text);
  }

  // The steady rub: its phase plane, and displacement and temperature over one period.
  function drawOrbit() {
    if (!model("orbit")) return;
    const curves = about.cases.entries[numberOf(place)]?.orbit, names = ["x", "v", "temperature"];
    const data = { x: [], v: [], temperature: [], phase: [] };
    curves?.forEach((entry, k) => {
      data[names[k]] = curve(entry, k === 0 ? about.cases.orbit.factor : 1);
      data[names[k]].push(data[names[k]][0]);
    });
    data.phase = data.x.map((_, k) => k / (data.x.length - 1));
    fill("orbit", data);
    const state = metrics.get("steady_state");
    say("orbit-about", (state ? `${written(state, valueOf(state, numberOf(place))).replaceAll("_", " ")}. ` : "")
      + (curves ? "Phase plane, then one period." : "The page holds no steady rub of this case."));
  }

  function draw() {
    drawCase();
    drawMap();
    if (error && cost) drawErrors("cost", error, (number) => valueOf(cost, number) / cost.factor / (about.duration ?? 1));
    if (error) drawErrors("order", ofScheme, (number, at) => about.h[at[about.h_dim]]);
    if (error) drawModes();
    drawPeriods();
    drawOrbit();
  }
  function select(wanted) {
    place = wanted;
    dims.forEach((dim, axis) => {
      const slider = model(`slider_${dim.name}`);
      if (slider) slider.value = dim.texts[place[axis]];
    });
    draw();
  }

  // What the reader does.
  dims.forEach((dim, axis) => {
    const slider = model(`slider_${dim.name}`);
    slider?.properties.value.change.connect(() => {
      const k = dim.texts.indexOf(slider.value);
      if (k >= 0 && k !== place[axis]) select(moved(place, { [axis]: k }));
    });
  });
  if (model("map")) {
    for (const name of ["metric", "across", "up"]) model(name).properties.value.change.connect(drawMap);
    model("map").on_event("tap", (event) => { const at = cellAt(event); if (at) select(at); });
    model("map").on_event("mousemove", (event) => {
      const at = cellAt(event), metric = metrics.get(model("metric").value);
      if (!at) return;
      const value = status[numberOf(at)] !== 0 || !metric ? about.statuses[status[numberOf(at)]] : written(metric, valueOf(metric, numberOf(at)));
      say("map-here", `${labels(at)}: ${value}`);
    });
    // Bokeh tells of a new width while it paints, when no data may change.
    model("map").properties.inner_width.change.connect(() => setTimeout(drawMap));
  }
  for (const name of ["cost_points", "order_points"]) {
    model(name)?.selected.properties.indices.change.connect(() => {
      const [k] = model(name).selected.indices;
      if (k === undefined) return;
      const number = model(name).data.case[k];
      model(name).selected.indices = [];
      select(placeOf(number));
    });
  }
  for (const button of document.querySelectorAll("button[data-case]")) {
    button.addEventListener("click", () => {
      select(placeOf(Number(button.dataset.case)));
      $("explore").scrollIntoView();
    });
  }
  select(place);
  document.body.dataset.ready = "yes";
})();
