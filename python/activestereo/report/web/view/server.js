// SPDX-License-Identifier: Apache-2.0
// Calls to the server, and its answers: numbers and images in one (see routes.py).

const TYPES = { float32: Float32Array, uint8: Uint8Array, uint32: Uint32Array };
const MOST_TRIES = 10; // of a server that is busy with other pages, a second apart

// The answer's content; its images are typed arrays by name in `images`. Throws what the server says is wrong.
async function called(name, given) {
  const call = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(given) };
  let answer = await fetch(name, call);
  for (let tries = 1; answer.status === 503 && tries < MOST_TRIES; ++tries) {
    await new Promise((resolve) => setTimeout(resolve, 1000));
    answer = await fetch(name, call);
  }
  if (!answer.ok) throw new Error(await answer.text());
  const bytes = await answer.arrayBuffer();
  const length = new DataView(bytes).getUint32(0, true);
  const content = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  content.images = {};
  for (const [own, [type, height, width, first]] of Object.entries(content.arrays)) {
    content.images[own] = new TYPES[type](bytes, 4 + length + first, height * width);
  }
  return content;
}
