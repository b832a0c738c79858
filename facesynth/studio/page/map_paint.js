// What is drawn on a map.

/** A line with an arrow at its end. */
export function path(c, places, colour, width) {
  c.strokeStyle = c.fillStyle = colour;
  c.lineWidth = width;
  c.beginPath();
  for (const [x, y] of places) c.lineTo(x, y);
  c.stroke();
  c.lineWidth = 1;
  const [x, y] = places.at(-1);
  const from = places.find(([a, b], k) => k >= places.length - 4 && Math.hypot(a - x, b - y) > 2) ?? places[0];
  const angle = Math.atan2(y - from[1], x - from[0]);
  c.beginPath();
  c.moveTo(x + 4 * Math.cos(angle), y + 4 * Math.sin(angle));
  for (const turn of [2.5, -2.5]) c.lineTo(x + 7 * Math.cos(angle + turn), y + 7 * Math.sin(angle + turn));
  c.fill();
}

/** The picture of a map: brightness 0 to 1 in three colours, row by row. */
export function bitmapOf({ width, height, numbers }) {
  const image = new ImageData(width, height);
  for (let i = 0, j = 0; i < numbers.length; i += 3, j += 4) {
    for (let k = 0; k < 3; k++) image.data[j + k] = Math.min(255, 24 + 231 * numbers[i + k]);
    image.data[j + 3] = 255;
  }
  return createImageBitmap(image);
}

/** A dot where each node is now, null where it is not shown; a ring about those that stood between the same phones. */
export function paintMarks(c, places, context) {
  places.forEach((place, k) => {
    if (!place) return;
    c.fillStyle = "#ffffff";
    c.beginPath();
    c.arc(...place, 2, 0, 7);
    c.fill();
    if (!context[k]) return;
    c.strokeStyle = "#ffd166";
    c.beginPath();
    c.arc(...place, 5.5, 0, 7);
    c.stroke();
  });
}
