// The material of the body and of its cut: a colour map by value, shaded by a lamp as in cases/picture.

import { DoubleSide, FrontSide, ShaderMaterial, Vector3, Vector4 } from "three";

// As in cases/picture: brightness away from the lamp and towards it, and the direction to the lamp.
const SHADED = 0.66;
const LAMP = new Vector3(-0.35, 0.5, 0.8).normalize();
// Stands for a value that is not known.
export const UNKNOWN = -1e30;

// Compiled with what is shown, since each part costs time: BY_VALUE: values are interpolated, unshaded (the cut of the
// volume), otherwise their positions on the map are (the body); OWN_COLOURS, EDGES, CUT.
const VERTEX = `
  attribute float value;
  uniform float low, high, logarithmic;
  varying float vShare, vUnknown;
  varying vec3 vNormal;
  #ifdef OWN_COLOURS
    attribute vec3 colour;
    varying vec3 vColour;
  #endif
  #ifdef EDGES
    attribute vec3 corner;
    varying vec3 vCorner;
  #endif
  #ifdef CUT
    uniform vec4 plane;
    varying float vAbove;
  #endif
  void main() {
    vUnknown = value < -1e29 ? 1.0 : 0.0;
    #ifdef BY_VALUE
      vShare = value;
    #else
      float kept = clamp(value, low, high);
      vShare = logarithmic > 0.5 ? log(kept / low) / log(high / low) : (kept - low) / (high - low);
      vNormal = normalMatrix * normal;
    #endif
    #ifdef OWN_COLOURS
      vColour = colour;
    #endif
    #ifdef EDGES
      vCorner = corner;
    #endif
    #ifdef CUT
      vAbove = dot(position, plane.xyz) - plane.w;
    #endif
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;

const FRAGMENT = `
  uniform float low, high, logarithmic;
  uniform sampler2D map;
  uniform vec3 lamp;
  varying float vShare, vUnknown;
  varying vec3 vNormal;
  #ifdef OWN_COLOURS
    varying vec3 vColour;
  #endif
  #ifdef EDGES
    varying vec3 vCorner;
  #endif
  #ifdef CUT
    varying float vAbove;
  #endif
  void main() {
    #ifdef CUT
      if (vAbove > 0.0) discard;
    #endif
    #ifdef OWN_COLOURS
      vec3 colour = vColour;
    #else
      float share = vShare;
      #ifdef BY_VALUE
        float kept = clamp(vShare, low, high);
        share = logarithmic > 0.5 ? log(kept / low) / log(high / low) : (kept - low) / (high - low);
      #endif
      vec3 colour = texture2D(map, vec2((share * 255.0 + 0.5) / 256.0, 0.5)).rgb;
      if (vUnknown > 0.0) colour = vec3(0.62, 0.64, 0.67);
    #endif
    #ifndef BY_VALUE
      vec3 facing = normalize(vNormal);
      if (facing.z < 0.0) facing = -facing;
      float cosine = clamp(dot(facing, lamp), 0.0, 1.0);
      colour *= ${SHADED.toFixed(2)} + ${(1 - SHADED).toFixed(2)} * cosine;
      if (!gl_FrontFacing) colour *= 0.6;
    #endif
    #ifdef EDGES
      vec3 wide = fwidth(vCorner);
      vec3 inside = smoothstep(0.2 * wide, 1.0 * wide, vCorner);
      float line = 1.0 - min(min(inside.x, inside.y), inside.z);
      vec3 ink = dot(colour, vec3(0.3, 0.6, 0.1)) > 0.4 ? vec3(0.0) : vec3(1.0);
      colour = mix(colour, ink, 0.35 * line);
    #endif
    gl_FragColor = vec4(colour, 1.0);
  }`;

export function colourMaterial() {
  const uniforms = { low: 0.1, high: 1, logarithmic: 1, map: null, plane: new Vector4(), lamp: LAMP };
  return new ShaderMaterial({
    uniforms: Object.fromEntries(Object.entries(uniforms).map(([name, value]) => [name, { value }])),
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
  });
}

// Compile the parts of the material that are shown. What is cut open is seen from inside too.
export function compileWith(material, parts) {
  const defines = Object.fromEntries(Object.keys(parts).filter((name) => parts[name]).map((name) => [name, 1]));
  if (JSON.stringify(defines) === JSON.stringify(material.defines)) return;
  material.defines = defines;
  material.side = parts.CUT || parts.BY_VALUE ? DoubleSide : FrontSide;
  material.needsUpdate = true;
}

// What is seen of a region through the body: strong at its rim, faint within.
export function rimMaterial() {
  return new ShaderMaterial({
    vertexShader: `
      varying vec3 vNormal;
      void main() {
        vNormal = normalMatrix * normal;
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
      }`,
    fragmentShader: `
      varying vec3 vNormal;
      void main() {
        float rim = pow(1.0 - abs(normalize(vNormal).z), 4.0);
        gl_FragColor = vec4(mix(vec3(1.0), vec3(0.05, 0.07, 0.1), rim), 0.04 + 0.6 * rim);
      }`,
    transparent: true,
    depthTest: false,
    depthWrite: false,
  });
}
