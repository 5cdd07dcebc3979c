// Shows what the page carries: the body by Plotly's mesh3d, the curves beside it, and one time for both.
"use strict";

(async () => {
  const byId = (name) => document.getElementById(name);

  async function inflated(name) {
    const text = byId(name).textContent;
    // Browsers of before 2025 have no faster way.
    const bytes = Uint8Array.fromBase64
      ? Uint8Array.fromBase64(text)
      : Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }

  function trouble(text) {
    byId("trouble").textContent = text;
    byId("trouble").hidden = false;
  }

  if (typeof DecompressionStream === "undefined") {
    trouble("The three-dimensional view and the curves need a newer browser (of 2023 or later).");
    return;
  }
  const content = JSON.parse(byId("content").textContent);
  const program = document.createElement("script");
  program.text = new TextDecoder().decode(await inflated("plotly"));
  document.head.append(program);
  performance.mark("program");
  const arrays = await inflated("arrays");
  const kinds = { f4: Float32Array, u2: Uint16Array, u4: Uint32Array };
  const array = (reference) =>
    new kinds[reference.kind](arrays, reference.at, reference.shape.reduce((size, length) => size * length, 1));

  const config = { displaylogo: false, responsive: true, displayModeBar: false };
  const figures = ["curves", "coupling"].filter((name) => content[name]);
  const heart = content.heart ? await viewer(content.heart) : null;
  for (const name of figures) {
    const figure = content[name];
    await Plotly.newPlot(name, figure.data, figure.layout, { ...config, doubleClick: "reset" });
    if (heart) byId(name).on("plotly_click", (event) => heart.goTo(event.points[0].x));
  }
  if (heart) heart.begin(figures);
  document.body.dataset.ready = "yes";

  // --- the body ------------------------------------------------------------------------------------------------------

  async function viewer(body) {
    const places = array(body.places);
    const node = array(body.node);
    const times = body.times_ms;
    const drawnNodes = node.length;
    const chosen = { frame: 0, playing: false };
    let linked = [];
    let busy = null;

    const option = (name) => (byId(name) ? Number(byId(name).value) : -1);
    const checked = (name) => Boolean(byId(name) && byId(name).checked);
    const coloring = () => body.colorings[option("coloring")];

    function view() {
      const cut = option("cut");
      return cut < 0 ? body.views[0] : body.cuts[cut].views[option("depth")];
    }

    // The arrays of a view, made when it is first shown.
    function opened(shown) {
      if (!shown.arrays) {
        const triangles = array(shown.triangles);
        const corner = (which) => Int32Array.from({ length: triangles.length / 3 }, (_, k) => triangles[3 * k + which]);
        shown.arrays = {
          start: array(shown.start), end: array(shown.end), share: array(shown.share), triangles,
          i: corner(0), j: corner(1), k: corner(2),
          edges: array(shown.edges), marked: shown.marked && array(shown.marked), weights: shown.weights && array(shown.weights),
        };
      }
      return shown.arrays;
    }

    // Where the vertices of a view are in a frame, as three arrays.
    function vertices(shown, frame) {
      const { start, end, share } = opened(shown);
      const first = Math.min(frame, body.places.shape[0] - 1) * drawnNodes * 3;
      return [0, 1, 2].map((axis) => Float32Array.from(start, (from, k) => {
        const begin = places[first + 3 * from + axis];
        return share[k] === 0 ? begin : begin + share[k] * (places[first + 3 * end[k] + axis] - begin);
      }));
    }

    function values(shown, frame) {
      const field = coloring();
      if (!field) return null;
      const { start, end, share } = opened(shown);
      const levels = field.array || (field.array = array(field.levels));
      const [frames, nodes] = field.levels.shape;
      const first = Math.min(frame, frames - 1) * nodes;
      const scale = (field.high - field.low) / 65535;
      return Float32Array.from(start, (from, k) => {
        const begin = levels[first + node[from]];
        return field.low + scale * (begin + share[k] * (levels[first + node[end[k]]] - begin));
      });
    }

    // The edges, and if asked for the fibres a little above the surface, as one line with gaps.
    function lines(shown, xyz) {
      const { edges } = opened(shown);
      const drawn = xyz.map((axis) => {
        const line = [];
        for (let k = 0; k < edges.length; k += 2) line.push(axis[edges[k]], axis[edges[k + 1]], null);
        return line;
      });
      if (checked("fibers") && shown.marked) addFibers(shown, xyz, drawn);
      return drawn;
    }

    function addFibers(shown, xyz, drawn) {
      const { triangles, marked, weights } = opened(shown);
      marked.forEach((triangle, mark) => {
        const corners = [0, 1, 2].map((k) => xyz.map((axis) => axis[triangles[3 * triangle + k]]));
        const [u, v] = [1, 2].map((k) => corners[k].map((value, axis) => value - corners[0][axis]));
        const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        const lift = (0.004 * body.size_mm) / (Math.hypot(...normal) || 1);
        for (let axis = 0; axis < 3; axis++) {
          for (let end = 0; end < 2; end++) {
            const weight = 6 * mark + 3 * end;
            const place = corners.reduce((sum, corner, k) => sum + weights[weight + k] * corner[axis], 0);
            drawn[axis].push(place + lift * normal[axis]);
          }
          drawn[axis].push(null);
        }
      });
    }

    function traces() {
      const shown = view();
      const { i, j, k } = opened(shown);
      const field = coloring();
      const [x, y, z] = vertices(shown, chosen.frame);
      const mesh = {
        type: "mesh3d", x, y, z, i, j, k, hoverinfo: "skip", flatshading: false,
        // A flat body has no shape to be told by light.
        lighting: body.flat ? { ambient: 1, diffuse: 0, specular: 0 } : { ambient: body.strand ? 0.9 : 0.6, diffuse: 0.5, specular: 0.04, roughness: 0.9, fresnel: 0.02 },
        lightposition: { x: -2000, y: -4000, z: 5000 },
      };
      if (field) {
        const bar = {
          orientation: "h", x: 0.5, xanchor: "center", y: 0, yanchor: "top", thickness: 12, len: 0.86,
          title: { text: field.label, side: "top" }, outlinewidth: 0.5, tickfont: { size: 11 },
        };
        if (field.ticks.length) Object.assign(bar, { tickvals: field.ticks });
        Object.assign(mesh, {
          intensity: values(shown, chosen.frame), cmin: field.low, cmax: field.high, colorscale: field.scale, colorbar: bar,
        });
      } else {
        mesh.color = "#c98a7d";
      }
      const [lx, ly, lz] = lines(shown, [x, y, z]);
      const all = [mesh, {
        type: "scatter3d", mode: "lines", x: lx, y: ly, z: lz, line: { color: "#1a1a1a", width: 3 }, hoverinfo: "skip",
        showlegend: false,
      }];
      if (checked("ghost")) {
        const rest = body.views[0];
        const [gx, gy, gz] = vertices(rest, 0);
        const { i: gi, j: gj, k: gk } = opened(rest);
        all.push({
          type: "mesh3d", x: gx, y: gy, z: gz, i: gi, j: gj, k: gk, color: "#8a94a0", opacity: 0.18, hoverinfo: "skip",
          showscale: false,
        });
      }
      return all;
    }

    function layout() {
      const lengths = body.box_mm.map(([low, high]) => Math.max(high - low, 1e-9));
      const longest = Math.max(...lengths);
      const thin = body.strand || body.flat;
      const scale = (body.strand ? 2.2 : body.flat ? 2 : 1.25) / longest;
      const hidden = { visible: false, showspikes: false };
      const axis = (name, place) => ({
        title: { text: `${name} (mm)`, font: { size: 11 } }, range: body.box_mm[place], tickfont: { size: 10 },
        gridcolor: "#dde1e6", zeroline: false, showbackground: false, showspikes: false, nticks: 6, color: "#5a6270",
      });
      const scene = {
        aspectmode: "manual",
        aspectratio: { x: scale * lengths[0], y: scale * lengths[1], z: scale * lengths[2] },
        xaxis: axis("x", 0),
        yaxis: body.strand ? { ...hidden, range: body.box_mm[1] } : axis("y", 1),
        zaxis: thin ? { ...hidden, range: body.box_mm[2] } : axis("z", 2),
        camera: {
          eye: body.flat ? { x: 0, y: 0, z: 1.6 } : body.strand ? { x: 0, y: -1.5, z: 0.35 } : { x: 0.5, y: -1.8, z: 1.05 },
          up: body.flat ? { x: 0, y: 1, z: 0 } : { x: 0, y: 0, z: 1 },
          center: { x: 0, y: 0, z: thin ? 0 : -0.15 },
          projection: { type: thin ? "orthographic" : "perspective" },
        },
        dragmode: body.flat ? "orbit" : "turntable",
        hovermode: false,
        uirevision: "same",
      };
      return {
        scene, margin: { l: 0, r: 0, t: 0, b: 64 }, paper_bgcolor: "white", uirevision: "same", showlegend: false,
        font: { family: "DejaVu Sans, Arial, sans-serif", size: 12, color: "#333" },
      };
    }

    async function redraw() {
      byId("note").textContent = coloring() ? coloring().note : "";
      if (byId("depth-label")) byId("depth-label").hidden = option("cut") < 0;
      await Plotly.react("heart", traces(), layout());
    }

    // Moves the body, and everything that tells the time, to the chosen frame.
    async function show() {
      const shown = view();
      const [x, y, z] = vertices(shown, chosen.frame);
      const [lx, ly, lz] = lines(shown, [x, y, z]);
      const moved = { x: [x, lx], y: [y, ly], z: [z, lz], intensity: [values(shown, chosen.frame), undefined] };
      tell();
      await Plotly.restyle("heart", moved, [0, 1]);
    }

    function tell() {
      const time = times[chosen.frame];
      byId("now").textContent = `${Number(time.toPrecision(6))} ms`;
      byId("time").value = chosen.frame;
      byId("time").setAttribute("aria-valuetext", byId("now").textContent);
      const cursor = {
        type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1, line: { color: "#b3261e", width: 1.5 },
      };
      for (const name of linked) Plotly.relayout(name, { shapes: [cursor] });
    }

    // One drawing at a time; what was chosen meanwhile is drawn after it.
    async function update(draw) {
      if (busy) {
        busy.again = busy.again === redraw ? redraw : draw;
        return;
      }
      busy = { again: draw };
      document.body.dataset.drawing = "yes";
      while (busy.again) {
        const next = busy.again;
        busy.again = null;
        await next();
      }
      busy = null;
      document.body.dataset.drawing = "no";
    }

    function goToFrame(frame) {
      chosen.frame = Math.min(Math.max(frame, 0), times.length - 1);
      return update(show);
    }

    function goTo(time) {
      pause();
      let nearest = 0;
      times.forEach((each, frame) => {
        if (Math.abs(each - time) < Math.abs(times[nearest] - time)) nearest = frame;
      });
      return goToFrame(nearest);
    }

    function play() {
      chosen.playing = true;
      byId("play").textContent = "❚❚ Pause";
      let before = performance.now();
      // The place in the run, from 0 to 1.
      let place = chosen.frame >= times.length - 1 ? 0 : chosen.frame / Math.max(times.length - 1, 1);
      const tick = async (now) => {
        if (!chosen.playing) return;
        place = (place + (now - before) / 1000 / Number(byId("speed").value)) % 1;
        before = now;
        const frame = Math.min(Math.floor(place * times.length), times.length - 1);
        if (frame !== chosen.frame) await goToFrame(frame);
        requestAnimationFrame(tick);
      };
      requestAnimationFrame(tick);
    }

    function pause() {
      chosen.playing = false;
      byId("play").textContent = "▶ Play";
    }

    const toggle = () => (chosen.playing ? pause() : play());

    function begin(figureNames) {
      linked = figureNames;
      tell();
      byId("play").addEventListener("click", toggle);
      byId("time").addEventListener("input", (event) => { pause(); goToFrame(Number(event.target.value)); });
      for (const name of ["coloring", "cut", "depth", "fibers", "ghost"]) {
        if (byId(name)) byId(name).addEventListener("input", () => update(redraw));
      }
      document.addEventListener("keydown", (event) => {
        const steps = { ArrowLeft: -1, ArrowRight: 1 };
        if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, select, button, summary, a")) return;
        if (event.key === " ") toggle();
        else if (steps[event.key]) { pause(); goToFrame(chosen.frame + steps[event.key]); }
        else return;
        event.preventDefault();
      });
    }

    byId("note").textContent = coloring() ? coloring().note : "";
    if (byId("depth-label")) byId("depth-label").hidden = true;
    await Plotly.newPlot("heart", traces(), layout(), { ...config, scrollZoom: true });
    performance.mark("first frame");
    return { begin, goTo };
  }
})();
