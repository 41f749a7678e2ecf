// SPDX-License-Identifier: Apache-2.0
// The slider of an effect's strength: it shows other pictures in the strip. All of them are in the page.

for (const strip of document.querySelectorAll("section.strip")) {
  const strengths = JSON.parse(strip.querySelector("script").textContent);
  const slider = strip.querySelector("input");
  const [, withIt, difference] = strip.querySelectorAll("img");
  slider.oninput = () => {
    const chosen = strengths[Number(slider.value)];
    withIt.src = chosen.with_it;
    difference.src = chosen.difference;
    strip.querySelector("output").textContent = chosen.words;
  };
  slider.oninput();
}
