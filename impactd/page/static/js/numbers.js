// Numbers as people read them, each with its unit.

/** Coverage factor of 95 % of a normal distribution, where JSON tells none. */
export const K_95 = 1.959963984540054;
const MOST_DECIMALS = 9;

/** Return "1.595 ± 0.018", with two digits of the expanded uncertainty U (95 %); the rule is `analysis/written_numbers.py`. */
export function measured(quantity, scale = 1) {
  if (quantity?.value === null || quantity?.value === undefined) return "–";
  const value = quantity.value * scale;
  const expanded = (quantity.expanded?.U ?? K_95 * (quantity.u ?? 0)) * scale;
  if (!(Number.isFinite(expanded) && expanded > 0)) return significant(value, 5);
  const [low, high] = quantity.interval95 ?? [null, null];
  if (low !== null && value - expanded < 0 && low * scale >= 0) {
    return `${significant(value, 2)} (95 %: ${significant(low * scale, 2)} .. ${high === null ? "any" : significant(high * scale, 2)})`;
  }
  const last = Math.floor(Math.log10(expanded));
  const largest = Math.max(Math.abs(value), expanded);
  if (1 - last > MOST_DECIMALS || largest >= 1e7) {
    const power = Math.floor(Math.log10(largest));
    const places = Math.max(0, power + 1 - last);
    const [one, other] = [value, expanded].map((number) => (number / 10 ** power).toFixed(places));
    return `(${one} ± ${other})e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}`;
  }
  const digits = Math.max(0, 1 - last);
  return `${value.toFixed(digits)} ± ${expanded.toFixed(digits)}`;
}

/** Return "3.150(87)": the digits in brackets are the standard uncertainty of the last ones (GUM 7.2.2). */
export function concise(value, u) {
  if (!(Number.isFinite(u) && u > 0)) return significant(value, 6);
  const digits = Math.max(0, 1 - Math.floor(Math.log10(u)));
  const bracket = u < 1 ? Math.round(u * 10 ** digits) : u.toFixed(digits);
  return `${value.toFixed(digits)}(${bracket})`;
}

/** Return the scale and unit in which a modulus is easy to read. */
export function modulusUnit(pascal) {
  return Math.abs(pascal) >= 1e9 ? [1e-9, "GPa"] : Math.abs(pascal) >= 1e6 ? [1e-6, "MPa"] : [1e-3, "kPa"];
}

/** Return the scale and unit of a column of moduli: those of its largest one, so that all can be compared. */
export function columnUnit(quantities) {
  return modulusUnit(Math.max(...quantities.map((one) => Math.abs(one?.value ?? 0))) || 1e9);
}

/** Return "1.595 ± 0.018 GPa", or null where there is no modulus. */
export function modulus(quantity) {
  if (quantity?.value === null || quantity?.value === undefined) return null;
  const [scale, unit] = modulusUnit(quantity.value);
  return `${measured(quantity, scale)} ${unit}`;
}

export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return String(Number(value.toPrecision(digits)));
}

/** Return "0.21 %"; `signed` writes a plus, too. What rounds to nothing is "< 0.01 %", never 0.00. */
export function percent(fraction, signed = false) {
  if (fraction === null || fraction === undefined || !Number.isFinite(fraction)) return "–";
  const size = Math.abs(fraction) * 100;
  if (size < 0.01) return "< 0.01 %";
  const sign = fraction < 0 ? "−" : signed ? "+" : "";
  return `${sign}${size >= 100 ? Math.round(size) : size.toPrecision(2)} %`;
}

export const millimetres = (metres) => (metres === null || metres === undefined ? "–" : `${significant(metres * 1e3, 4)} mm`);

/** Return a duration in words: "about 40 s", "about 3 min". */
export function duration(seconds) {
  if (seconds === null || seconds === undefined) return null;
  if (seconds < 90) return `about ${Math.max(1, Math.round(seconds))} s`;
  if (seconds < 5400) return `about ${Math.round(seconds / 60)} min`;
  return `about ${significant(seconds / 3600, 2)} h`;
}

const DAY = new Intl.DateTimeFormat("en-GB", { day: "numeric", month: "short", year: "numeric" });
const MOMENT = new Intl.DateTimeFormat("en-GB", { day: "numeric", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit" });
const CLOCK = new Intl.DateTimeFormat("en-GB", { hour: "2-digit", minute: "2-digit", second: "2-digit" });

export const day = (utc) => (utc ? DAY.format(new Date(utc)) : "–");
export const moment = (utc) => (utc ? MOMENT.format(new Date(utc)) : "–");
export const clock = (when) => CLOCK.format(new Date(when));

/** Return how many there are of a thing: "1 shot", "2 shots". */
export const counted = (count, thing) => `${count} ${thing}${count === 1 ? "" : "s"}`;

/** Return how far off a day is: "in 12 days", "today", "3 days ago". */
export function inDays(utc) {
  const days = Math.round((new Date(utc) - Date.now()) / 86400e3);
  if (days === 0) return "today";
  const many = counted(Math.abs(days), "day");
  return days > 0 ? `in ${many}` : `${many} ago`;
}
