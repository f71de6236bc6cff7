/** The picture of the path by WebGL 2: Three.js, and a shader of our own for the path itself. */
import {
  AmbientLight,
  BufferAttribute,
  BufferGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  DirectionalLight,
  GLSL3,
  Group,
  Line,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  OrthographicCamera,
  RawShaderMaterial,
  Scene,
  Sphere,
  Vector3,
  WebGLRenderer,
} from "three";
import { type Chunk, type PathData, levelFor, thinned } from "./data";
import type { Frame, Picture } from "./picture";
import { boxLines } from "./box";
import type { View } from "./view";

// Flat: a segment has the colour of the vertex at its end.
const VERTEX = `
precision highp float;
in vec3 position;
in float kind;
in float done;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 rapid;
uniform vec3 feed;
uniform vec3 probe;
uniform vec3 ramp[5];
uniform vec2 span;
flat out vec4 colour;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  vec3 planned = kind < 1.5 ? rapid : kind > 3.5 ? probe : feed;
  if (done < 0.5) {
    colour = vec4(planned, kind < 1.5 ? 0.55 : 0.9);
  } else {
    float share = done < 1.5 ? 0.0 : clamp((done - span.x) / max(1.0, span.y - span.x), 0.0, 1.0) * 4.0;
    int i = int(min(3.0, floor(share)));
    colour = vec4(mix(ramp[i], ramp[i + 1], share - float(i)), 1.0);
  }
}`;
const FRAGMENT = `
precision mediump float;
flat in vec4 colour;
out vec4 seen;
void main() {
  seen = colour;
}`;

/** A picture in motion that takes longer has less of the path; after some that took one frame of the screen it may have more. */
const SLOW_MS = 36;
const FAST_MS = 20;
const FAST_ENOUGH = 10;
const STRIDE_MAX = 64;

let software: boolean | null = null;

/** Whether the processor draws in place of a graphics card: smooth edges would take it four times as long. */
function isSoftware(): boolean {
  if (software !== null) return software;
  const context = document.createElement("canvas").getContext("webgl2");
  const told = context?.getExtension("WEBGL_debug_renderer_info");
  const name = String((told && context?.getParameter(told.UNMASKED_RENDERER_WEBGL)) ?? "");
  // Not given back by hand: Chromium may wait half a minute for that.
  software = /swiftshader|llvmpipe|softpipe|basic render/i.test(name);
  return software;
}

/** What of a chunk is on the graphics card: one set of vertices, and a list of indices for each level. */
interface Drawn {
  line: Line;
  geometries: BufferGeometry[];
  /** The same of a share of the parts, by level and stride. */
  thinned: Map<string, BufferGeometry>;
  revision: number;
  doneChanged: number;
}

/** A tool, whose tip is its place. */
function marker(material: MeshLambertMaterial): Group {
  const shaft = new Mesh(new CylinderGeometry(0.32, 0.32, 1.1, 24), material);
  shaft.rotation.x = Math.PI / 2;
  shaft.position.z = 1.05;
  const tip = new Mesh(new ConeGeometry(0.32, 0.5, 24), material);
  tip.rotation.x = -Math.PI / 2;
  tip.position.z = 0.25;
  const group = new Group();
  group.add(shaft, tip);
  return group;
}

export class ScenePicture implements Picture {
  private renderer: WebGLRenderer;
  private scene = new Scene();
  private camera = new OrthographicCamera();
  private drawn = new Map<Chunk, Drawn>();
  private material: RawShaderMaterial;
  private furniture = new Group();
  private furnitureKey = "";
  private toolMaterial = new MeshLambertMaterial();
  private tool = marker(this.toolMaterial);
  private previewMaterial = new MeshLambertMaterial({ transparent: true, opacity: 0.85 });
  private preview = marker(this.previewMaterial);
  private tail: Line;
  private context: WebGL2RenderingContext;
  /** Signalled once the last picture is drawn, and when that was begun, ms. */
  private fence: WebGLSync | null = null;
  private begun = 0;
  /** While the picture moves, one of so many parts of the path is drawn: as many as this machine draws in time. */
  private stride = 1;
  /** Pictures in motion, one behind the other, that took less than they may. */
  private fast = 0;
  private moving = false;

  /** Throws where there is no WebGL 2. */
  constructor(canvas: HTMLCanvasElement) {
    const context = canvas.getContext("webgl2", { antialias: !isSoftware(), alpha: false, preserveDrawingBuffer: false });
    if (!context) throw new Error("no WebGL 2");
    this.context = context;
    this.renderer = new WebGLRenderer({ canvas, context });
    this.material = new RawShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      glslVersion: GLSL3,
      transparent: true,
      uniforms: {
        rapid: { value: new Color() },
        feed: { value: new Color() },
        probe: { value: new Color() },
        ramp: { value: Array.from({ length: 5 }, () => new Color()) },
        span: { value: [2, 255] },
      },
    });
    this.camera.matrixAutoUpdate = false;
    const light = new DirectionalLight(0xffffff, 2.2);
    light.position.set(-1, -2, 3);
    this.tail = new Line(
      new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(6), 3)),
      new LineBasicMaterial(),
    );
    this.tail.frustumCulled = false;
    this.scene.add(light, new AmbientLight(0xffffff, 1.1), this.furniture, this.tool, this.preview, this.tail);
  }

  draw(view: View, data: PathData, frame: Frame, moving: boolean): void {
    const { colours } = frame;
    this.moving = moving;
    this.begun = performance.now();
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(view.width, view.height, false);
    this.renderer.setClearColor(colours.background, 1);
    this.stand(view);
    this.furnish(frame);
    this.path(view, data, frame);
    this.place(view, data, frame);
    this.renderer.render(this.scene, this.camera);
    this.fence = this.context.fenceSync(this.context.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.context.flush();
  }

  ready(): boolean {
    if (!this.fence) return true;
    if (this.context.getSyncParameter(this.fence, this.context.SYNC_STATUS) !== this.context.SIGNALED) return false;
    this.context.deleteSync(this.fence);
    this.fence = null;
    const took = performance.now() - this.begun;
    if (!this.moving) return true;
    this.fast = took < FAST_MS ? this.fast + 1 : 0;
    // Half the parts take about half the time.
    if (took > SLOW_MS) this.stride = Math.min(STRIDE_MAX, this.stride * 2 ** Math.ceil(Math.log2(took / SLOW_MS)));
    else if (this.fast >= FAST_ENOUGH) [this.stride, this.fast] = [Math.max(1, this.stride / 2), 0];
    return true;
  }

  private stand(view: View): void {
    const [right, up, out] = view.axes();
    const far = 20_000;
    const camera = this.camera;
    camera.right = view.width / 2 / view.pixels_per_mm;
    camera.left = -camera.right;
    camera.top = view.height / 2 / view.pixels_per_mm;
    camera.bottom = -camera.top;
    camera.near = 0;
    camera.far = 2 * far;
    camera.updateProjectionMatrix();
    const at = view.target.map((value, k) => value + far * out[k]!);
    camera.matrix.set(right[0], up[0], out[0], at[0], right[1], up[1], out[1], at[1], right[2], up[2], out[2], at[2], 0, 0, 0, 1);
    camera.matrixWorldNeedsUpdate = true;
    camera.updateMatrixWorld(true);
  }

  private path(view: View, data: PathData, { colours, span }: Frame): void {
    const { rapid, feed, probe, ramp } = this.material.uniforms;
    rapid.value.set(colours.rapid);
    feed.value.set(colours.feed);
    probe.value.set(colours.probe);
    ramp.value.forEach((colour: Color, i: number) => colour.set(colours.ramp[i]!));
    this.material.uniforms.span.value = span;
    // Colours as they are told, not as light.
    for (const colour of [rapid.value, feed.value, probe.value, ...ramp.value]) colour.convertLinearToSRGB();
    for (const [chunk, drawn] of this.drawn) if (!data.chunks.includes(chunk)) this.drop(chunk, drawn);
    const level = levelFor(view.pixels_per_mm);
    const stride = this.moving ? this.stride : 1;
    for (const chunk of data.chunks) {
      const drawn = this.upToDate(chunk);
      drawn.line.geometry = !chunk.levels ? drawn.geometries[0] : stride > 1 ? this.thinned(drawn, chunk, level, stride) : drawn.geometries[level];
    }
  }

  /** Made when it is first asked for. */
  private thinned(drawn: Drawn, chunk: Chunk, level: number, stride: number): BufferGeometry {
    const key = `${level}/${stride}`;
    let made = drawn.thinned.get(key);
    if (!made) {
      const whole = drawn.geometries[0];
      made = new BufferGeometry();
      for (const name of ["position", "kind", "done"]) made.setAttribute(name, whole.getAttribute(name));
      made.setIndex(new BufferAttribute(thinned(chunk, level, stride), 1));
      made.boundingSphere = whole.boundingSphere;
      drawn.thinned.set(key, made);
    }
    return made;
  }

  private upToDate(chunk: Chunk): Drawn {
    let drawn = this.drawn.get(chunk);
    if (!drawn) {
      const whole = new BufferGeometry();
      whole.setAttribute("position", new BufferAttribute(chunk.xyz, 3));
      whole.setAttribute("kind", new BufferAttribute(chunk.kind, 1));
      whole.setAttribute("done", new BufferAttribute(chunk.done, 1));
      drawn = { line: new Line(whole, this.material), geometries: [whole], thinned: new Map(), revision: -1, doneChanged: chunk.doneChanged };
      this.drawn.set(chunk, drawn);
      this.scene.add(drawn.line);
    }
    const whole = drawn.geometries[0];
    if (drawn.revision !== chunk.revision) {
      drawn.revision = chunk.revision;
      for (const name of ["position", "kind", "done"]) whole.getAttribute(name).needsUpdate = true;
      whole.setDrawRange(0, chunk.count);
      if (chunk.levels && drawn.geometries.length === 1) {
        for (const indices of chunk.levels) {
          const level = new BufferGeometry();
          for (const name of ["position", "kind", "done"]) level.setAttribute(name, whole.getAttribute(name));
          level.setIndex(new BufferAttribute(indices, 1));
          drawn.geometries.push(level);
        }
      }
      const [lower, upper] = [new Vector3(...chunk.min), new Vector3(...chunk.max)];
      const middle = lower.clone().add(upper).multiplyScalar(0.5);
      const sphere = new Sphere(middle, middle.distanceTo(upper));
      for (const geometry of drawn.geometries) geometry.boundingSphere = sphere;
    }
    if (drawn.doneChanged !== chunk.doneChanged) {
      drawn.doneChanged = chunk.doneChanged;
      whole.getAttribute("done").needsUpdate = true;
    }
    return drawn;
  }

  private drop(chunk: Chunk, drawn: Drawn): void {
    this.scene.remove(drawn.line);
    for (const geometry of [...drawn.geometries, ...drawn.thinned.values()]) geometry.dispose();
    this.drawn.delete(chunk);
  }

  /** Box of the travel, its floor, zero of the machine and of the work. */
  private furnish({ box, zeros, colours, unit }: Frame): void {
    const key = JSON.stringify([box, zeros, colours, unit]);
    if (key === this.furnitureKey) return;
    this.furnitureKey = key;
    for (const child of [...this.furniture.children]) {
      child.geometry.dispose();
      child.material.dispose();
      this.furniture.remove(child);
    }
    const lines = (places: number[], colour: string, opacity = 1) =>
      this.furniture.add(
        new LineSegments(
          new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(places), 3)),
          new LineBasicMaterial({ color: colour, transparent: opacity < 1, opacity }),
        ),
      );
    if (box) {
      const { edges, grid } = boxLines(box);
      lines(grid, colours.grid, 0.5);
      lines(edges, colours.box);
    }
    for (const zero of zeros) {
      for (let k = 0; k < 3; k++) {
        const end = zero.place.map((value, i) => value + zero.axes[k]![i]! * unit * (zero.large ? 1.4 : 1));
        lines([...zero.place, ...end], colours.axes[k]!);
      }
    }
  }

  private place(view: View, data: PathData, { tool, preview, colours, tailFrom }: Frame): void {
    this.preview.visible = preview !== null;
    if (preview) {
      this.previewMaterial.color.set(colours.preview);
      this.preview.position.set(...preview);
      this.preview.scale.setScalar(26 / view.pixels_per_mm);
    }
    this.tool.visible = tool !== null;
    this.tail.visible = tool !== null && tailFrom !== null;
    if (!tool) return;
    this.toolMaterial.color.set(colours.tool);
    this.tool.position.set(...tool);
    // As large at each distance: it shows where the tool is, not how large it is.
    this.tool.scale.setScalar(26 / view.pixels_per_mm);
    if (tailFrom !== null) {
      const ends = this.tail.geometry.getAttribute("position");
      const from = data.vertex(tailFrom);
      for (let k = 0; k < 3; k++) {
        ends.array[k] = from[k];
        ends.array[3 + k] = tool[k];
      }
      ends.needsUpdate = true;
      this.tail.material.color.set(colours.ramp[2]!);
    }
  }

  dispose(): void {
    for (const [chunk, drawn] of this.drawn) this.drop(chunk, drawn);
    this.renderer.dispose();
  }
}
