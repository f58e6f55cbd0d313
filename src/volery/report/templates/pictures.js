// The last recorded picture of each topic.
document.querySelectorAll(".picture").forEach((canvas, index) => {
  const { rows, columns, channels, pixels } = stage.data.pictures[index];
  const bytes = atob(pixels);
  const picture = new ImageData(columns, rows);
  for (let pixel = 0; pixel < rows * columns; pixel++) {
    for (let part = 0; part < 3; part++) {
      picture.data[4 * pixel + part] = bytes.charCodeAt(channels * pixel + (channels === 3 ? part : 0));
    }
    picture.data[4 * pixel + 3] = 255;
  }
  canvas.width = columns;
  canvas.height = rows;
  canvas.getContext("2d").putImageData(picture, 0, 0);
});
