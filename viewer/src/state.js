// What the parts of the page share: which maps are shown, at which frame, in which theme.
export class State {
  constructor(values) {
    this.values = values;
    this.listeners = [];
  }

  get(name) {
    return this.values[name];
  }

  set(changes) {
    const changed = Object.keys(changes).filter((name) => this.values[name] !== changes[name]);
    if (changed.length === 0) return;
    Object.assign(this.values, changes);
    for (const listener of this.listeners) listener(new Set(changed));
  }

  // Calls `listener` now and whenever one of `names` changes.
  watch(names, listener) {
    this.listeners.push((changed) => {
      if (names.some((name) => changed.has(name))) listener();
    });
    listener();
  }
}

// The key frame nearest to a frame.
export function nearestFrame(frames, frame) {
  return frames.reduce((best, each) => (Math.abs(each - frame) < Math.abs(best - frame) ? each : best));
}
