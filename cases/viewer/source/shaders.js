// The material of the body and of its cut: a colour map by value, shaded by a lamp as in cases/picture.

import { DoubleSide, ShaderMaterial, Vector3, Vector4 } from "three";

// As in cases/picture: brightness away from the lamp and towards it, and the direction to the lamp.
const SHADED = 0.66;
const LAMP = new Vector3(-0.35, 0.5, 0.8).normalize();
// Stands for a value that is not known.
export const UNKNOWN = -1e30;

const VERTEX = `
  attribute float value;
  attribute vec3 colour;
  attribute vec3 corner;
  uniform float low, high, logarithmic;
  varying float vValue, vShare, vUnknown;
  varying vec3 vNormal, vColour, vCorner, vPlace;
  void main() {
    vUnknown = value < -1e29 ? 1.0 : 0.0;
    vValue = value;
    float kept = clamp(value, low, high);
    vShare = logarithmic > 0.5 ? log(kept / low) / log(high / low) : (kept - low) / (high - low);
    vNormal = normalMatrix * normal;
    vColour = colour;
    vCorner = corner;
    vPlace = position;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;

const FRAGMENT = `
  uniform float low, high, logarithmic, byValue, ownColours, edges, cut;
  uniform sampler2D map;
  uniform vec4 plane;
  uniform vec3 lamp;
  varying float vValue, vShare, vUnknown;
  varying vec3 vNormal, vColour, vCorner, vPlace;
  void main() {
    if (cut > 0.5 && dot(vPlace, plane.xyz) > plane.w) discard;
    float share = vShare;
    if (byValue > 0.5) {
      float kept = clamp(vValue, low, high);
      share = logarithmic > 0.5 ? log(kept / low) / log(high / low) : (kept - low) / (high - low);
    }
    vec3 colour = texture2D(map, vec2((share * 255.0 + 0.5) / 256.0, 0.5)).rgb;
    if (vUnknown > 0.0) colour = vec3(0.62, 0.64, 0.67);
    if (ownColours > 0.5) colour = vColour;
    if (byValue < 0.5) {
      vec3 facing = normalize(vNormal);
      if (facing.z < 0.0) facing = -facing;
      float cosine = clamp(dot(facing, lamp), 0.0, 1.0);
      colour *= ${SHADED.toFixed(2)} + ${(1 - SHADED).toFixed(2)} * cosine;
      if (!gl_FrontFacing) colour *= 0.6;
    }
    if (edges > 0.5) {
      vec3 wide = fwidth(vCorner);
      vec3 inside = smoothstep(0.2 * wide, 1.0 * wide, vCorner);
      float line = 1.0 - min(min(inside.x, inside.y), inside.z);
      vec3 ink = dot(colour, vec3(0.3, 0.6, 0.1)) > 0.4 ? vec3(0.0) : vec3(1.0);
      colour = mix(colour, ink, 0.35 * line);
    }
    gl_FragColor = vec4(colour, 1.0);
  }`;

// `byValue`: values are interpolated, unshaded (the cut); otherwise their positions on the map are (the body).
export function colourMaterial(byValue) {
  const uniforms = {
    low: 0.1,
    high: 1,
    logarithmic: 1,
    byValue: byValue ? 1 : 0,
    ownColours: 0,
    edges: 0,
    cut: 0,
    map: null,
    plane: new Vector4(),
    lamp: LAMP,
  };
  return new ShaderMaterial({
    uniforms: Object.fromEntries(Object.entries(uniforms).map(([name, value]) => [name, { value }])),
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    side: DoubleSide,
  });
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
