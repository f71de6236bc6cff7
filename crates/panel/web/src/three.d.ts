/** What the picture of the path takes of Three.js; its own package of types brings 40 others. */
declare module "three" {
  class Any {
    constructor(...given: unknown[]);
    [name: string]: any;
  }
  export class AmbientLight extends Any {}
  export class BufferAttribute extends Any {}
  export class BufferGeometry extends Any {}
  export class Color extends Any {}
  export class ConeGeometry extends Any {}
  export class CylinderGeometry extends Any {}
  export class DirectionalLight extends Any {}
  export class Group extends Any {}
  export class Line extends Any {}
  export class LineBasicMaterial extends Any {}
  export class LineSegments extends Any {}
  export class Mesh extends Any {}
  export class MeshLambertMaterial extends Any {}
  export class OrthographicCamera extends Any {}
  export class RawShaderMaterial extends Any {}
  export class Scene extends Any {}
  export class Sphere extends Any {}
  export class Vector3 extends Any {}
  export class WebGLRenderer extends Any {}
  export const GLSL3: string;
}
