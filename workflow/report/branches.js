// Branches of a report: a click on a point shows the orbit that is stored with it.
"use strict";
(async () => {
  const parts = JSON.parse(document.getElementById("branch-figures").textContent);
  for (const name of ["branches", "orbit"]) await Bokeh.embed.embed_item(parts[name], `figure-${name}`);
  const model = (name) => Bokeh.documents.map((one) => one.get_model_by_name(name)).find((one) => one != null);
  const points = model("branch_points");
  function show(k) {
    const closed = (name, factor) => {
      const values = Array.from(points.data[name][k], (value) => factor * value);
      return [...values, values[0]];
    };
    const x = closed("orbit_displacement", parts.factor);
    const phase = x.map((_, sample) => sample / (x.length - 1));
    model("orbit").data = { x, v: closed("orbit_velocity", 1), temperature: closed("orbit_temperature", 1), phase };
    model("branch_here").data = { x: [points.data.x[k]], y: [points.data.y[k]] };
    document.getElementById("orbit-about").textContent = `${points.data.text[k]}. Phase plane, then one period.`;
  }
  points.selected.properties.indices.change.connect(() => {
    const [k] = points.selected.indices;
    if (k === undefined) return;
    points.selected.indices = [];
    show(k);
  });
  show(0);
  document.body.dataset.ready = "yes";
})();
