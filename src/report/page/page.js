"use strict";
// The page's scenes. Data lies in the page as JSON; large arrays in it are base 64 of little-endian numbers. Points are
// fractions of their scene's box, in 16 bits.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const SIDES = data.side_colours;
  const GREY = "#9a9a9a";
  const RAMP = data.ramp;

  const ofSides = (sides) => SIDES[Math.min(sides, SIDES.length - 1)];
  const ramp = (t) => {
    const at = Math.min(Math.max(t, 0), 1) * (RAMP.length - 1);
    const below = Math.min(Math.floor(at), RAMP.length - 2);
    return new THREE.Color(RAMP[below]).lerp(new THREE.Color(RAMP[below + 1]), at - below);
  };

  // What cells can be coloured by: a figure of the cell, its title, and how it is written.
  const FIGURES = {
    sides: { title: "sides" },
    curvature: { title: "Gaussian curvature K (1/" + data.unit + "²)", digits: 5 },
    area: { title: "area (" + data.unit + "²)", digits: 0 },
    volume: { title: "volume (" + data.unit + "³)", digits: 0 },
    pressure: { title: "pressure over the mean (tension/" + data.unit + ")", digits: 4 },
  };

  const range = (values) => {
    const finite = values.filter((v) => v !== null).sort((a, b) => a - b);
    return finite.length ? [finite[0], finite[finite.length - 1]] : [0, 1];
  };

  function legend(element, cells, key) {
    element.replaceChildren();
    const entry = (swatch, text) => {
      const span = document.createElement("span");
      span.append(swatch, text);
      element.append(span);
    };
    if (key === "sides") {
      const counts = new Map();
      cells.sides.forEach((n) => counts.set(n, (counts.get(n) || 0) + 1));
      for (const [n, count] of [...counts].sort((a, b) => (a[0] === null) - (b[0] === null) || a[0] - b[0])) {
        const swatch = document.createElement("i");
        swatch.style.background = n === null ? GREY : ofSides(n);
        entry(swatch, n === null ? `not counted: ${count}` : `${n} sides: ${count}`);
      }
      return;
    }
    const [low, high] = range(cells[key]);
    const swatch = document.createElement("i");
    swatch.className = "ramp";
    swatch.style.background = `linear-gradient(90deg, ${RAMP.join(",")})`;
    const text = (v) => Number(v.toPrecision(3)).toString().replace("-", "−");
    entry(swatch, `${FIGURES[key].title}: ${text(low)} to ${text(high)}`);
  }

  function points(text, { low, high }) {
    const fractions = new Uint16Array(bytes(text));
    return Float32Array.from(fractions, (f, i) => low[i % 3] + (f / 65535) * (high[i % 3] - low[i % 3]));
  }

  function geometry(mesh, box) {
    const shape = new THREE.BufferGeometry();
    const corners = mesh.bits === 16 ? Uint16Array : Uint32Array;
    shape.setAttribute("position", new THREE.BufferAttribute(points(mesh.positions, box), 3));
    shape.setIndex(new THREE.BufferAttribute(new corners(bytes(mesh.triangles)), 1));
    shape.computeVertexNormals();
    return shape;
  }

  class Stage {
    constructor(figure, scene) {
      this.figure = figure;
      this.data = scene;
      this.canvas = figure.querySelector("canvas");
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, preserveDrawingBuffer: true });
      this.renderer.setClearColor(0xffffff, 1);
      this.scene = new THREE.Scene();
      this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb8b0a0, 2.0));
      this.lamp = new THREE.DirectionalLight(0xffffff, 1.6);
      this.scene.add(this.lamp);
      this.camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
      this.camera.up.set(0, 0, 1);
      this.controls = new THREE.OrbitControls(this.camera, this.canvas);
      this.controls.enableDamping = false;
      this.controls.addEventListener("change", () => this.draw());
      this.layers = new Map();
      scene.layers.forEach((layer) => this.addLayer(layer));
      const [low, high] = [new THREE.Vector3(...scene.low), new THREE.Vector3(...scene.high)];
      this.middle = low.clone().add(high).multiplyScalar(0.5);
      this.size = high.clone().sub(low).length();
      this.home();
      this.canvas.addEventListener("keydown", (event) => this.key(event));
      new ResizeObserver(() => this.resize()).observe(this.canvas);
      this.resize();
    }

    addLayer(layer) {
      const shape = geometry(layer, this.data);
      const cells = layer.cell_of_vertex ? new Uint16Array(bytes(layer.cell_of_vertex)) : null;
      const material = new THREE.MeshStandardMaterial({
        color: cells ? 0xffffff : layer.colour, roughness: 0.8, metalness: 0, side: THREE.DoubleSide,
        vertexColors: Boolean(cells), transparent: layer.opacity < 1, opacity: layer.opacity,
        depthWrite: layer.opacity === 1,
      });
      const mesh = new THREE.Mesh(shape, material);
      mesh.visible = layer.shown;
      this.scene.add(mesh);
      this.layers.set(layer.name, { mesh, cells, layer });
      if (cells) {
        shape.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * cells.length), 3));
        this.colour(layer.name, "sides");
      }
      if (layer.lines) {
        const lines = new THREE.BufferGeometry();
        lines.setAttribute("position", new THREE.BufferAttribute(points(layer.lines, this.data), 3));
        const drawn = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: 0x222222 }));
        mesh.add(drawn);
      }
      if (layer.pairs) {
        const lines = new THREE.BufferGeometry();
        lines.setAttribute("position", new THREE.BufferAttribute(new Float32Array(layer.pairs.flat()), 3));
        const drawn = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: 0xd55e00 }));
        this.layers.set(layer.name + " pairs", { mesh: drawn });
        this.scene.add(drawn);
      }
    }

    colour(name, key) {
      const { mesh, cells, layer } = this.layers.get(name);
      const [low, high] = key === "sides" ? [0, 1] : range(layer.cells[key]);
      const of = layer.cells[key].map((value) => {
        if (value === null) return new THREE.Color(GREY);
        return key === "sides" ? new THREE.Color(ofSides(value)) : ramp((value - low) / (high - low || 1));
      });
      const target = mesh.geometry.getAttribute("color");
      cells.forEach((cell, vertex) => target.setXYZ(vertex, of[cell].r, of[cell].g, of[cell].b));
      target.needsUpdate = true;
      const box = this.figure.querySelector(".legend");
      if (box) legend(box, layer.cells, key);
      this.draw();
    }

    show(name, shown) {
      this.layers.get(name).mesh.visible = shown;
      this.draw();
    }

    home() { this.look(new THREE.Vector3(0.55, -1.0, 0.62)); }
    top() { this.look(new THREE.Vector3(0, -0.001, 1)); }

    look(direction) {
      const narrow = Math.min(1, this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight));
      this.controls.target.copy(this.middle);
      this.camera.position.copy(this.middle).addScaledVector(direction.normalize(), (1.75 * this.size) / narrow);
      this.camera.near = 0.02 * this.size;
      this.camera.far = 20 * this.size;
      this.camera.updateProjectionMatrix();
      this.controls.update();
      this.draw();
    }

    turn(across, upward) {
      const offset = this.camera.position.clone().sub(this.controls.target);
      // Spherical coordinates have y upward.
      const round = new THREE.Spherical().setFromVector3(new THREE.Vector3(offset.x, offset.z, -offset.y));
      round.theta += across;
      round.phi = Math.min(Math.max(round.phi + upward, 0.01), Math.PI - 0.01);
      const back = new THREE.Vector3().setFromSpherical(round);
      this.camera.position.copy(this.controls.target).add(new THREE.Vector3(back.x, -back.z, back.y));
      this.controls.update();
      this.draw();
    }

    zoom(factor) {
      const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
      this.camera.position.copy(this.controls.target).add(offset);
      this.controls.update();
      this.draw();
    }

    key(event) {
      const actions = {
        ArrowLeft: () => this.turn(-0.12, 0), ArrowRight: () => this.turn(0.12, 0),
        ArrowUp: () => this.turn(0, -0.12), ArrowDown: () => this.turn(0, 0.12),
        "+": () => this.zoom(0.9), "=": () => this.zoom(0.9), "-": () => this.zoom(1.1), Home: () => this.home(),
      };
      if (actions[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) {
        actions[event.key]();
        event.preventDefault();
      }
    }

    resize() {
      const { clientWidth: width, clientHeight: height } = this.canvas;
      if (!width || !height) return;
      this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      this.draw();
    }

    draw() {
      this.lamp.position.copy(this.camera.position).add(new THREE.Vector3(0.3, 0.2, 1).multiplyScalar(0.5 * this.size || 1));
      this.renderer.render(this.scene, this.camera);
    }
  }

  for (const figure of document.querySelectorAll(".scene")) {
    const scene = data.scenes[figure.dataset.scene];
    let stage;
    try {
      stage = new Stage(figure, scene);
    } catch (error) {
      const notice = document.createElement("p");
      notice.className = "missing";
      notice.textContent = "This picture needs WebGL, which this browser does not offer. The files beside the page hold it too.";
      figure.querySelector("canvas").replaceWith(notice);
      continue;
    }
    for (const control of figure.querySelectorAll("[data-show]")) {
      control.addEventListener("change", () => stage.show(control.dataset.show, control.checked));
    }
    for (const control of figure.querySelectorAll("[data-colour]")) {
      control.addEventListener("change", () => stage.colour(control.dataset.colour, control.value));
    }
    for (const control of figure.querySelectorAll("[data-look]")) {
      control.addEventListener("click", () => stage[control.dataset.look]());
    }
    for (const control of figure.querySelectorAll("[data-turn]")) {
      control.addEventListener("click", () => stage.turn(Number(control.dataset.turn), 0));
    }
  }

  for (const link of document.querySelectorAll("a[data-table]")) {
    const text = data.tables[link.dataset.table];
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = link.dataset.table;
  }
  document.body.dataset.ready = "yes";
})();
