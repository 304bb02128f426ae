// The interactive part of a report: fills figures made with Bokeh with the numbers of the cases that the page holds.
// All text from the archive is set as text, never as markup; nothing is fetched.
"use strict";
(async () => {
  const $ = (id) => document.getElementById(id);
  const packed = Uint8Array.from(atob($("data").textContent), (letter) => letter.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const { about, drawn, roots } = await new Response(unpacked).json();
  await Bokeh.embed.embed_items({ page: drawn }, [{ docid: "page", roots, root_ids: Object.keys(roots) }]);

  const model = (name) => Bokeh.documents[0].get_model_by_name(name); // null where the page has no such part
  const fill = (name, data) => { model(name).data = data; };
  function fillImage(name, values, rows, height, [start, end]) {
    const NDArray = model(name).data.image[0].constructor; // Bokeh's array with a shape
    const image = new NDArray(Float32Array.from(values), [rows, values.length / rows]);
    fill(name, { image: [image], x: [start], y: [0], dw: [end - start], dh: [height] });
  }
  const say = (id, text) => { if ($(id)) $(id).textContent = text; };
  const numbers = (list) => Array.from(list ?? [], (value) => value ?? NaN); // JSON has null for what is not finite

  function showOrbit(orbit, text) { // the steady rub's phase plane, and displacement and temperature over one period
    const [x, v, temperature] = orbit ?? [[], [], []];
    fill("orbit", { x, v, temperature, phase: x.map((_, k) => k / (x.length - 1)) });
    say("orbit-about", text);
  }
  function onTap(name, select) { // calls select with the row of a source that is clicked
    model(name)?.selected.properties.indices.change.connect(() => {
      const [k] = model(name).selected.indices;
      if (k === undefined) return;
      model(name).selected.indices = [];
      select(k);
    });
  }

  // Branches: a click on a point shows the orbit that is stored with it.
  function exploreBranches() {
    const { x, y, text } = model("branch_points").data;
    function select(k) {
      showOrbit(about.orbits[k], `${text[k]}. Phase plane, then one period.`);
      fill("branch_here", { x: [x[k]], y: [y[k]] });
    }
    onTap("branch_points", select);
    select(0);
  }

  // Cases: numbers count them along the dimensions, a place has an index along each.
  function exploreCases() {
    const { dims, status, exact, statuses, cases } = about, shape = dims.map((dim) => dim.texts.length);
    const metrics = new Map(about.metrics.map((metric) => [metric.name, metric]));
    const numberOf = (at) => at.reduce((sum, k, axis) => sum * shape[axis] + k, 0);
    const placeOf = (number) => shape.reduceRight(
      ([at, rest], size) => [[rest % size, ...at], Math.floor(rest / size)], [[], number])[0];
    const moved = (at, changes) => at.map((k, axis) => changes[axis] ?? k);
    let place = placeOf(about.start);
    const placesAlong = (axes) => axes.reduce( // the selected place with every combination of values of some axes
      (list, axis) => list.flatMap((at) => dims[axis].texts.map((_, k) => moved(at, { [axis]: k }))), [place]);

    function short(value) {
      if (value === 0) return "0";
      if (!Number.isFinite(value)) return "–";
      const size = Math.abs(value);
      return size >= 0.01 && size < 1e4 ? String(Number(value.toPrecision(3))) : value.toExponential(1);
    }
    const unitOf = (thing) => (thing.unit ? ` ${thing.unit}` : "");
    const written = (metric, value) => (metric.words ? metric.words[value] ?? "–" : short(value) + unitOf(metric));
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

    // The case that is selected.
    function drawCase() {
      const number = numberOf(place), entry = cases?.entries[number], name = statuses[status[number]];
      say("case-labels", labels(place));
      say("case-status", name === "ok" ? "" : `This case is ${name}${entry?.message ? `: ${entry.message}` : "."}`);
      say("case-command", selection(place));
      const known = about.metrics.filter((metric) => metric.values[number] !== null);
      $("case-metrics").replaceChildren(...known.map((metric) => {
        const row = document.createElement("tr");
        for (const text of [metric.title, written(metric, metric.values[number]), metric.about]) row.insertCell().textContent = text;
        return row;
      }));
      if (model("chosen")) drawHistories(number, entry, exact[number]);
      if (model("orbit")) {
        const state = metrics.get("steady_state"), word = state ? `${written(state, state.values[number])}. `.replaceAll("_", " ") : "";
        showOrbit(entry?.orbit, word + (entry?.orbit ? "Phase plane, then one period." : "The page holds no steady rub of this case."));
      }
      if (model("periods")) drawPeriods(entry?.periods);
      if (model("contacts")) drawContacts(entry?.contacts);
      if (model("worn")) {
        const { angle = [], depth = [], text } = entry?.worn ?? {};
        fill("worn_depths", { angle, depth });
        say("worn-about", text ?? "The page does not hold the worn depths of this case.");
      }
    }
    function drawHistories(number, entry, partner) { // with those of its exact partner behind
      const other = partner === number ? undefined : cases.entries[partner];
      const curves = (one) => Object.fromEntries(cases.histories.map((name) => [name, numbers(one?.curves[name])]));
      fill("chosen", { t: entry ? cases.t : [], ...curves(entry) });
      fill("exact", { t: other ? cases.t : [], ...curves(other) });
      const span = [cases.t[0], cases.t[cases.t.length - 1]], gap = entry?.gap ?? other?.gap ?? [];
      fill("gap", { t: gap.length === 2 ? span : gap.length ? cases.t : [], gap });
      showTimes(span, entry?.window);
      const without = `This page holds the histories of ${Object.keys(cases.entries).length} of ${status.length} cases, and not of `
        + "this one: the line below reads them from the archive. ";
      const reference = partner === number ? "This case is the exact solution itself."
        : other ? `Exact solution: ${labels(placeOf(partner))}.`
          : "The archive holds no exact case (event_driven) of this scene that ended ok.";
      say("case-exact", (entry ? "" : without) + reference
        + (cases.thinned ? " Thinned: the least and the largest value of each short interval." : ""));
    }
    function drawContacts({ names, force } = { names: [], force: [] }) { // a row for each contact, the first on top
      const values = names.length ? force.flat().map((value) => value || NaN) : [NaN];
      fillImage("contact_cells", values, names.length || 1, names.length, [cases.t[0], cases.t[cases.t.length - 1]]);
      Object.assign(model("contact_colours"), { low: 0, high: force.flat().reduce((most, value) => Math.max(most, value), 0) || 1 });
      Object.assign(model("contacts").y_range, { start: names.length, end: 0 });
      model("contact_names").ticker.ticks = names.map((_, k) => k + 0.5);
      model("contact_names").major_label_overrides = new Map(names.map((name, k) => [k + 0.5, name]));
      say("contacts-title", names.length ? `Force of each contact; most loaded: contact ${names[0]}` : "Force of each contact");
      say("contacts-about", names.length ? "White: no contact." : "The page does not hold the contacts of this case.");
    }
    let shownTimes = "";
    function showTimes(span, window) { // all, or the window of a case; what the reader has chosen stays
      const [start, end] = [window?.start ?? span[0], span[1]];
      say("case-window", window?.text ?? "");
      if (shownTimes === String([start, end])) return;
      shownTimes = String([start, end]);
      Object.assign(model("time"), { start, end, reset_start: span[0], reset_end: span[1] });
    }
    function drawPeriods(periods) {
      const { impulse = [], predicted = [], range = [0, 1], text } = periods ?? {}, period = impulse.map((_, k) => k + 1);
      fill("period_impulses", { period, impulse });
      fill("predicted", { period, impulse: numbers(predicted) });
      Object.assign(model("periods").y_range, { start: range[0], end: range[1] });
      say("periods-about", text ?? "The page does not hold the load periods of this case.");
    }

    // The map: cells along two axes, or a point for each case where its drawn numbers are.
    const titleOf = (thing) => thing.title + (thing.unit ? ` [${thing.unit}]` : "");
    function sideOf(menu) { // what lies along a side: the cells of a dimension, or a number that is drawn along it
      const [name, k] = model(menu).value.split(":"), axis = dims.findIndex((dim) => dim.name === name);
      return axis < 0 ? null : { axis, title: titleOf(dims[axis]), texts: dims[axis].texts, ...(k ? dims[axis].numbers[k] : {}) };
    }
    const spotOn = (side, at) => (side ? side.values?.[at[side.axis]] ?? at[side.axis] + 0.5 : 0.5);
    let spots = { places: [], x: [], y: [] };
    function drawMap() {
      const figure = model("map");
      if (!figure) return;
      sayHere(place);
      let [across, up] = ["across", "up"].map(sideOf);
      const isGrid = !across.values && !up?.values;
      if (isGrid && up?.axis === across.axis) up = null;
      const places = placesAlong([...new Set([up, across].filter(Boolean).map((side) => side.axis))]); // row by row
      spots = { places, x: places.map((at) => spotOn(across, at)), y: places.map((at) => spotOn(up, at)) };
      const metric = metrics.get(model("metric").value), found = places.map(numberOf);
      const values = metric ? numbers(found.map((number) => metric.values[number])) : found.map((number) => status[number]);
      say("map-about", metric ? `${titleOf(metric)}: ${metric.about}. Grey with a cross: not ok.` : "How each case ended.");
      const [width, height] = [showSide("x", across), showSide("y", up)];
      figure.height = isGrid ? Math.min(470, Math.max(290, 170 + 36 * height)) : 420;
      const [w, h] = isGrid ? [1, 1] : [0.03 * width, 0.04 * height];
      fill("cell", { x: [spotOn(across, place)], y: [spotOn(up, place)], w: [w], h: [h] });
      const scale = colourScale(values, metric);
      model(`image_${scale.name}`).visible = isGrid;
      if (isGrid) fillImage(`cells_${scale.name}`, values, height, height, [0, width]);
      fill("points", isGrid ? { x: [], y: [], value: [] } : { x: spots.x, y: spots.y, value: values });
      const isBad = (k) => metric && status[found[k]] !== 0 && (!isGrid || found.length <= 2500);
      const bad = found.map((_, k) => k).filter(isBad), [x, y] = [spots.x, spots.y].map((list) => bad.map((k) => list[k]));
      fill("bad", { x, y });
      writeValues(isGrid && metric && !metric.words && (figure.inner_width ?? 400) / width > 48 && height <= 20 ? values : [], scale);
    }
    function showSide(name, side) { // returns how long it is
      const [low, high] = side?.values ? [Math.min(...side.values), Math.max(...side.values)] : [0, side?.texts.length ?? 1];
      const margin = side?.values ? 0.04 * (high - low) || 1 : 0, axis = model(`map_${name}`);
      Object.assign(model("map")[`${name}_range`], { start: low - margin, end: high + margin });
      axis.axis_label = side?.title ?? "";
      axis.major_label_overrides = new Map(side?.values ? [] : (side?.texts ?? [""]).map((text, k) => [k + 0.5, text]));
      axis.ticker.ticks = side?.values ? [0, 1, 2, 3, 4].map((part) => Number((low + part / 4 * (high - low)).toPrecision(3)))
        : [...axis.major_label_overrides.keys()];
      return high - low + 2 * margin;
    }
    function colourScale(values, metric) { // logarithmic where values are positive and span more than a factor of 30
      let [low, high, least] = [Infinity, -Infinity, Infinity];
      for (const value of values.filter(Number.isFinite)) {
        low = Math.min(low, value); high = Math.max(high, value);
        if (value > 0) least = Math.min(least, value);
      }
      const logarithmic = low >= 0 && least < Infinity && high > 30 * least;
      const name = !metric ? "statuses" : metric.words ? "states" : logarithmic ? "log" : "linear";
      const from = logarithmic ? least : low, to = high > from ? high : from + (Math.abs(from) || 1);
      if (name === "log" || name === "linear") Object.assign(model(name), Number.isFinite(from) ? { low: from, high: to } : { low: 0, high: 1 });
      for (const other of ["statuses", "states", "log", "linear"]) {
        for (const part of ["bar", "image", "points"]) model(`${part}_${other}`).visible = other === name;
      }
      const share = (value) => (logarithmic ? Math.log(value / from) / Math.log(to / from) : (value - from) / (to - from));
      return { name, share };
    }
    const inkOn = (share) => (share > 0.5 ? "black" : "white");
    function writeValues(values, scale) {
      const known = values.map((_, k) => k).filter((k) => Number.isFinite(values[k])), of = (list) => known.map((k) => list[k]);
      const text = of(values).map(short), colour = of(values).map((value) => inkOn(scale.share(value)));
      fill("values", { x: of(spots.x), y: of(spots.y), text, colour });
    }
    function sayHere(at) { // the line under the map: of the case that is selected, or under the pointer
      const metric = metrics.get(model("metric").value), number = numberOf(at), isWord = status[number] !== 0 || !metric;
      say("map-here", `${labels(at)}: ${isWord ? statuses[status[number]] : written(metric, metric.values[number])}`);
    }
    function placeAt(event) { // of the cell or the point that is nearest
      const { x_range, y_range } = model("map"), lies = (at, { start, end }) => at >= start && at <= end;
      if (!lies(event.x, x_range) || !lies(event.y, y_range)) return null;
      const far = (k) => ((spots.x[k] - event.x) / (x_range.end - x_range.start)) ** 2
        + ((spots.y[k] - event.y) / (y_range.end - y_range.start)) ** 2;
      return spots.places[spots.places.reduce((nearest, _, k) => (far(k) < far(nearest) ? k : nearest), 0)];
    }

    // Errors against cost and step: a line through the steps for each scheme, the scene being that of the selected case.
    const error = metrics.get("error"), cost = metrics.get("processor_time");
    const ofScheme = metrics.get("scheme_error") ?? error, ofModel = metrics.get("model_error") ?? error;
    const look = (k) => ({ colour: about.colours[k % about.colours.length], marker: about.markers[k % about.markers.length] });
    const isNumber = (axis) => axis !== null;
    function drawErrors(name, measure, xOf) {
      if (!model(name)) return;
      const varied = about.h_dim === null ? about.numerical : [...new Set([about.scheme_dim, about.h_dim].filter(isNumber))];
      const rows = placesAlong(varied).map((at) => {
        const number = numberOf(at), h = about.h[at[about.h_dim] ?? 0];
        return { number, scheme: at[about.scheme_dim] ?? 0, h, x: xOf(number, h), y: measure.values[number] };
      }).filter((row) => row.y !== null && row.x > 0);
      const shown = rows.filter((row) => row.y > 0), column = (list, key) => list.map((row) => row[key]);
      fill(`${name}_points`, {
        x: column(shown, "x"), y: column(shown, "y"), case: column(shown, "number"),
        colour: shown.map((row) => look(row.scheme).colour), marker: shown.map((row) => look(row.scheme).marker),
        scheme: shown.map((row) => about.schemes[row.scheme]), h: shown.map((row) => (row.h == null ? "" : `${short(row.h)} s`)),
      });
      logAxis(name, "x", column(rows, "x"));
      logAxis(name, "y", [...column(shown, "y"), ...(name === "cost" && shown.length ? [0.1, 0.001] : [])]);
      const lines = { x: [], y: [], colour: [] }, keys = [];
      about.schemes.forEach((label, k) => {
        const all = rows.filter((row) => row.scheme === k), line = shown.filter((row) => row.scheme === k).sort((a, b) => a.h - b.h);
        const isExact = all.length > 0 && line.length === 0;
        if (about.h_dim !== null && line.length > 1) {
          lines.x.push(column(line, "x")); lines.y.push(column(line, "y")); lines.colour.push(look(k).colour);
        }
        const remark = all.length > line.length ? (name === "cost" ? "dotted: no error" : "no error")
          : all.length === 0 ? "not ok" : name === "order" ? `order ${about.order[line[0].number]?.toFixed(2) ?? "–"}` : "";
        keys.push([label, isExact ? { colour: "#000000", marker: "line" } : look(k), remark]);
      });
      fill(`${name}_lines`, lines);
      const flat = column(rows.filter((row) => row.y === 0), "x").sort((a, b) => a - b), middle = flat[Math.floor(flat.length / 2)];
      fill(`${name}_exact`, name === "cost" && flat.length ? { x: [[middle, middle]], y: [[1e-30, 1e30]] } : { x: [], y: [] });
      const here = shown.filter((row) => row.number === numberOf(place));
      fill(`${name}_here`, { x: column(here, "x"), y: column(here, "y") });
      writeKey(`${name}-key`, keys);
    }
    function logAxis(name, side, values) { // range and ticks: powers of ten, with 2 and 5 between where these are few
      if (!values.length) return;
      const [start, end] = [Math.min(...values) / 1.4, Math.max(...values) * 1.4], decades = Math.log10(end / start);
      const powers = Array.from({ length: Math.ceil(decades) + 2 }, (_, k) => k + Math.floor(Math.log10(start)));
      const every = Math.max(1, Math.ceil(decades / 7)), firsts = decades < 2 ? [1, 2, 5] : [1];
      const ticks = powers.filter((k) => k % every === 0).flatMap((k) => firsts.map((first) => [Number(`${first}e${k}`), `${first}e${k}`]));
      const axis = model(`${name}_${side}`);
      Object.assign(model(name)[`${side}_range`], { start, end });
      axis.ticker.ticks = ticks.map(([at]) => at);
      axis.major_label_overrides = new Map(ticks);
    }
    const SIGNS = { circle: "●", square: "■", triangle: "▲", diamond: "◆", inverted_triangle: "▼", plus: "✚", x: "✖", star: "★", line: "┊" };
    function writeKey(id, keys) {
      $(id).replaceChildren(...keys.map(([label, { colour, marker }, remark]) => {
        const item = document.createElement("span"), sign = document.createElement("i");
        sign.textContent = SIGNS[marker];
        sign.style.color = colour;
        item.append(sign, ` ${label}${remark ? ` (${remark})` : ""}`);
        return item;
      }));
    }

    // Errors of the reduced models.
    function drawModes() {
      if (!model("modes")) return;
      const sides = [about.modes.mechanical_modes, about.modes.thermal_modes];
      const countsAt = (at) => sides.map((side) => side.texts[side.dim === null ? 0 : at[side.dim]]);
      const rows = placesAlong([...new Set(sides.map((side) => side.dim).filter(isNumber))]);
      const counts = rows.map(countsAt), found = rows.map(numberOf), values = found.map((number) => ofModel.values[number]);
      const known = values.filter((value) => value > 0), [low, high] = [Math.min(...known), Math.max(...known)];
      if (known.length) Object.assign(model("modes_colours"), { low, high: high > low ? high : 10 * low });
      fill("modes_points", {
        x: counts.map(([x]) => x), y: counts.map(([, y]) => y), name: counts.map((pair) => pair.join(" + ")),
        error: values.map((value) => (value === 0 ? low : value ?? NaN)),
        text: values.map((value, k) => (value === null ? statuses[status[found[k]]] : short(value))),
        colour: values.map((value) => (value === null ? "black" : inkOn(Math.log(value / low) / Math.log(high / low)))),
      });
      const [x, y] = countsAt(place);
      fill("modes_here", { x: [x], y: [y] });
    }

    const sliders = dims.map((dim) => model(`slider_${dim.name}`));
    function select(wanted) {
      place = wanted;
      sliders.forEach((slider, axis) => { if (slider) slider.value = dims[axis].texts[place[axis]]; });
      drawCase();
      drawMap();
      if (error && cost) drawErrors("cost", error, (number) => cost.values[number] / about.cost_unit);
      if (error) drawErrors("order", ofScheme, (_, h) => h);
      if (error) drawModes();
    }

    // What the reader does.
    sliders.forEach((slider, axis) => slider?.properties.value.change.connect(() => {
      const k = dims[axis].texts.indexOf(slider.value);
      if (k >= 0 && k !== place[axis]) select(moved(place, { [axis]: k }));
    }));
    if (model("map")) {
      for (const name of ["metric", "across", "up"]) model(name).properties.value.change.connect(drawMap);
      model("map").on_event("tap", (event) => { const at = placeAt(event); if (at) select(at); });
      model("map").on_event("mousemove", (event) => { const at = placeAt(event); if (at) sayHere(at); });
      // Bokeh tells of a new width while it paints, when no data may change.
      model("map").properties.inner_width.change.connect(() => setTimeout(drawMap));
    }
    for (const name of ["cost_points", "order_points"]) onTap(name, (k) => select(placeOf(model(name).data.case[k])));
    for (const button of document.querySelectorAll("button[data-case]")) {
      button.addEventListener("click", () => {
        select(placeOf(Number(button.dataset.case)));
        $("explore").scrollIntoView();
      });
    }
    select(place);
  }

  if (about.dims) exploreCases();
  else exploreBranches();
  document.body.dataset.ready = "yes";
})();
