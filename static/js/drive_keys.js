/* The keys that steer, wherever somebody steers. */

export const KEYS = { ArrowUp: "forward", ArrowLeft: "left", ArrowRight: "right", p: "pickup", o: "toggle" };
