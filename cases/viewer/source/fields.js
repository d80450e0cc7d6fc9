// The fields of a run: found by quantity, channel and light, and unpacked when they are first shown.

import { unpack } from "./arrays.js";

export const ALL = "all";

export class Fields {
  constructor(list) {
    this.list = list;
    this.unpacked = new Map();
  }

  get quantities() {
    return [...new Set(this.list.map((field) => field.quantity))];
  }

  // Names of the channels, or of the lights, in which a quantity is known.
  names(quantity, kind) {
    return [...new Set(this.list.filter((field) => field.quantity === quantity).map((field) => field[kind]))];
  }

  // Times at which a quantity is known, s; none of one that does not depend on time.
  times(quantity) {
    return this.list.filter((field) => field.quantity === quantity && "time" in field).map((field) => field.time);
  }

  // The field of a channel and a light, or of all of them where it is not known for each, at the nth of its times.
  find(quantity, channel, light, moment = 0) {
    const own = this.list.filter((field) => field.quantity === quantity);
    if ("time" in own[0]) return own[Math.min(moment, own.length - 1)];
    const match = (c, l) => own.find((field) => field.channel === c && field.light === l);
    return match(channel, light) ?? match(channel, ALL) ?? match(ALL, light) ?? match(ALL, ALL) ?? own[0];
  }

  async values(field) {
    if (!this.unpacked.has(field)) this.unpacked.set(field, await unpack(field.values));
    return this.unpacked.get(field);
  }
}

// The range of colours of a field in a scale; a linear one begins at 0 or the least value.
export function rangeOf(field, logarithmic) {
  const [bottom, top] = field.ends ?? [0.1, 1];
  return logarithmic || !field.logarithmic ? [bottom, top] : [0, top];
}
