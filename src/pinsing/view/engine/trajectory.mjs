// Joint positions out of a CSV text: names in the first line, in any order, or none at all.

// Rows (n each) in the order of `joints`, radians and metres.
export function parseTrajectory(text, joints) {
  const lines = text.split(/\r?\n/).filter((line) => line.trim() && !line.trim().startsWith("#"));
  if (!lines.length) throw new Error("the file is empty");
  const split = (line) => line.split(/[,;\t]/).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"));
  let columns = joints.map((_, j) => j), first = 0;
  const head = split(lines[0]);
  if (head.some((cell) => !Number.isFinite(Number(cell)))) {
    first = 1;
    columns = joints.map(({ name }) => head.indexOf(name));
    const lacking = joints.filter((_, j) => columns[j] < 0).map(({ name }) => name);
    if (lacking.length) throw new Error(`no column for ${lacking.join(", ")}`);
  } else if (head.length === joints.length + 1) columns = columns.map((j) => j + 1); // a time before
  else if (head.length !== joints.length) throw new Error(`${head.length} columns for ${joints.length} joints`);
  const rows = lines.slice(first).map((line, i) => {
    const cells = split(line);
    return columns.map((c) => {
      const value = cells[c] === "" || cells[c] === undefined ? NaN : Number(cells[c]);
      if (!Number.isFinite(value)) throw new Error(`line ${first + i + 1}: ${cells[c] ?? "nothing"} is not a number`);
      return value;
    });
  });
  if (!rows.length) throw new Error("the file has no samples");
  return rows;
}
