// What the pages take of three.js; `make three` makes three.min.js of it.

export {
  AxesHelper, Box3, BoxGeometry, BufferAttribute, BufferGeometry, Color, ColorManagement, CylinderGeometry, DirectionalLight,
  Group, HemisphereLight, LatheGeometry, LineBasicMaterial, LineSegments, LinearSRGBColorSpace, MathUtils, Matrix4, Mesh,
  MeshBasicMaterial, MeshStandardMaterial, PCFShadowMap, PerspectiveCamera, Plane, PlaneGeometry, Quaternion, Raycaster,
  Scene, ShadowMaterial, SphereGeometry, Vector2, Vector3, Vector4, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { TransformControls } from "three/addons/controls/TransformControls.js";
