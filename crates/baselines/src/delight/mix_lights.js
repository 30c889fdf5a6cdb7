"use strict";
// Adds the pictures of a room's lights, each times its slider, in linear light.
(() => {
  const STEPS = 4096;
  const linear = Float32Array.from({ length: 256 }, (_, code) => {
    const v = code / 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  });
  const coded = Uint8ClampedArray.from({ length: STEPS + 1 }, (_, step) => {
    const v = step / STEPS;
    return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
  });

  const pixels = async (img, divisor) => {
    await img.decode();
    const canvas = new OffscreenCanvas(img.naturalWidth, img.naturalHeight);
    const context = canvas.getContext("2d");
    context.drawImage(img, 0, 0);
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    return Float32Array.from(data, (code, at) => (at % 4 === 3 ? 0 : divisor * linear[code]));
  };

  const start = async (room) => {
    const context = room.querySelector("canvas").getContext("2d");
    const rest = room.querySelector("img[data-rest]");
    const base = await pixels(rest, Number(rest.dataset.rest));
    const lights = await Promise.all(
      [...room.querySelectorAll("img[data-light]")].map((img) => pixels(img, Number(img.dataset.light))),
    );
    const sliders = [...room.querySelectorAll("input")];
    const draw = () => {
      const sum = base.slice();
      sliders.forEach((slider, which) => {
        const factor = Number(slider.value);
        slider.nextElementSibling.value = factor.toFixed(2);
        if (factor > 0) lights[which].forEach((v, at) => { sum[at] += factor * v; });
      });
      const { width, height } = context.canvas;
      const shown = context.createImageData(width, height);
      sum.forEach((v, at) => {
        shown.data[at] = at % 4 === 3 ? 255 : coded[Math.round(Math.min(v, 1) * STEPS)];
      });
      context.putImageData(shown, 0, 0);
    };
    room.addEventListener("input", draw);
    room.querySelector("button").addEventListener("click", () => {
      sliders.forEach((slider) => { slider.value = 1; });
      draw();
    });
    draw();
  };

  document.querySelectorAll(".relit").forEach((room) => start(room));
})();
