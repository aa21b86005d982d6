// Whether two pictures look alike: both are averaged over blocks of 4 x 4 pixels, which forgives
// the edges that renderers draw differently, and compared in CIELAB, where a distance of 2.3 is just
// noticeable (Mahy et al. 1994).

const kMeanLimit = 2.0;     // over the picture
const kBlockLimit = 12.0;   // a block is another colour
const kShareLimit = 0.01;   // of blocks that are

// `page` decodes the PNGs, which are data URLs.
export function compareImages(page, a, b) {
  return page.evaluate(async ({ urls, limits }) => {
    const kBlock = 4;
    const linear = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
    const curve = (t) => (t > 0.008856 ? Math.cbrt(t) : 7.787 * t + 16 / 116);
    async function blocks(url) {
      const image = new Image();
      image.src = url;
      await image.decode();
      const canvas = document.createElement('canvas');
      canvas.width = image.naturalWidth;
      canvas.height = image.naturalHeight;
      const context = canvas.getContext('2d', { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      const { data, width, height } = context.getImageData(0, 0, canvas.width, canvas.height);
      const list = [];
      for (let y = 0; y + kBlock <= height; y += kBlock) {
        for (let x = 0; x + kBlock <= width; x += kBlock) {
          const sum = [0, 0, 0];
          for (let k = 0; k < kBlock * kBlock; ++k) {
            const at = 4 * ((y + Math.floor(k / kBlock)) * width + x + (k % kBlock));
            for (let c = 0; c < 3; ++c) sum[c] += linear(data[at + c]) / (kBlock * kBlock);
          }
          const [r, g, bl] = sum;
          const fx = curve((0.4124 * r + 0.3576 * g + 0.1805 * bl) / 0.9505);
          const fy = curve(0.2126 * r + 0.7152 * g + 0.0722 * bl);
          const fz = curve((0.0193 * r + 0.1192 * g + 0.9505 * bl) / 1.089);
          list.push([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)]);
        }
      }
      return { list, size: `${width}x${height}` };
    }
    const [first, second] = await Promise.all(urls.map(blocks));
    if (first.size !== second.size) return { alike: false, sizes: [first.size, second.size] };
    const distances = first.list.map((lab, i) => Math.hypot(...lab.map((x, c) => x - second.list[i][c])));
    const mean = distances.reduce((sum, d) => sum + d, 0) / distances.length;
    const share = distances.filter((d) => d > limits.block).length / distances.length;
    return { alike: mean <= limits.mean && share <= limits.share, mean, share };
  }, { urls: [a, b], limits: { mean: kMeanLimit, block: kBlockLimit, share: kShareLimit } });
}
