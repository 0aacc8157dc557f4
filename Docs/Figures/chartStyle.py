"""What the charts share: colours, marks, the placement of labels, and files that do not change from run to run."""
import csv
import itertools

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

# Colours of Okabe and Ito, which colour-blind readers can tell apart. The sky blue is darker, for thin lines on white.
VERMILLION, BLUE, GREEN, SKY, BLACK = "#D55E00", "#0072B2", "#009E73", "#3E9BD0", "#333333"
RECOMMENDED = VERMILLION  # the colour of the recommended methods, in every chart

# Each method has one colour and one mark in every chart.
COLOUR = {"Auto": RECOMMENDED, "Auto: distinct": RECOMMENDED, "Continuous": RECOMMENDED, "Intersection": SKY, "Proximity": BLUE,
          "Proximity in substeps": GREEN, "FCL": BLACK,
          "DistanceField": RECOMMENDED, "Proxy": GREEN}
MARK = {"Auto": "o", "Auto: distinct": "h", "Continuous": "D", "Intersection": "v", "Proximity": "s", "Proximity in substeps": "^",
        "FCL": "X", "DistanceField": "o", "Proxy": "P"}

plt.rcParams.update({
    "font.family": "DejaVu Sans", "font.size": 9, "axes.titlesize": 11, "axes.titleweight": "bold", "axes.spines.top": False,
    "axes.spines.right": False, "axes.edgecolor": "#666666", "axes.linewidth": 0.8, "grid.color": "#e6e6e6", "grid.linewidth": 0.7,
    "svg.hashsalt": "palpate", "svg.fonttype": "path", "figure.facecolor": "white"})


def read(path):
    """Rows of a CSV as dictionaries. Fields that are numbers become numbers."""
    def value(text):
        try:
            return float(text)
        except ValueError:
            return text
    with open(path, newline="") as file:
        return [{key: value(text) for key, text in row.items()} for row in csv.DictReader(file)]


def distinct(values):
    return list(dict.fromkeys(values))


def save(figure, path):
    """Writes PATH.svg, without a date: the same figures give the same bytes."""
    figure.savefig(f"{path}.svg", metadata={"Date": None, "Creator": None})


def distanceTo(box, x, y):
    left, right, low, high = box
    return (max(left - x, 0, x - right) ** 2 + max(low - y, 0, y - high) ** 2) ** 0.5


def placeLabels(axes, labels, obstacles, gap=6.0, reach=95.0):
    """Writes each label (text, x, y, colour, whether bold) near its point, free of other labels and of obstacles.

    Points and obstacles are in data coordinates; gap and reach are in typographic points. Among candidate places in
    growing distance, the routine takes the one that covers least and is not nearer to another label's point. A line joins a
    label to its point if they are apart.
    """
    figure = axes.figure
    renderer = figure.canvas.get_renderer()
    scale = figure.dpi / 72
    toPixels = axes.transData.transform
    blocked = [tuple(toPixels(point)) for point in obstacles]
    frame = axes.get_window_extent(renderer)
    points = [tuple(toPixels(label[1:3])) for label in labels]
    taken = []
    distances = [gap + 6 * i for i in range(int(reach / 6))]
    directions = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1), (2, 1), (-2, 1), (2, -1), (-2, -1),
                  (1, 2), (-1, 2), (1, -2), (-1, -2)]
    for text, x, y, colour, bold in labels:
        px, py = toPixels((x, y))
        written = axes.annotate(text, (x, y), xytext=(0, 0), textcoords="offset points", fontsize=8.5 if bold else 8,
                                fontweight="bold" if bold else "normal", color=colour, ha="center", va="center", zorder=9,
                                bbox={"facecolor": "white", "alpha": 0.65, "edgecolor": "none", "pad": 0.4})
        box = written.get_window_extent(renderer)
        width, height = box.width, box.height
        best = None
        for rank, (distance, (dx, dy)) in enumerate(itertools.product(distances, directions)):
            length = (dx * dx + dy * dy) ** 0.5
            # The label's nearest edge is at this distance.
            cx = px + dx / length * distance * scale + (dx > 0) * width / 2 - (dx < 0) * width / 2
            cy = py + dy / length * distance * scale + (dy > 0) * height / 2 - (dy < 0) * height / 2
            left, right, low, high = cx - width / 2 - 1.5, cx + width / 2 + 1.5, cy - height / 2 - 1, cy + height / 2 + 1
            cost = 0.07 * distance + 1e-4 * rank
            if left < frame.x0 or right > frame.x1 + 4 * scale or low < frame.y0 or high > frame.y1 + 2 * scale:
                cost += 1000
            cost += 200 * sum(not (right < l or r < left or high < b or t < low) for l, r, b, t in taken)
            margin = 2.5 * scale
            cost += 3 * sum(left - margin < bx < right + margin and low - margin < by < high + margin for bx, by in blocked)
            own = distanceTo((left, right, low, high), px, py)
            for qx, qy in points:
                if (qx, qy) != (px, py):
                    cost += 4 * (distanceTo((left, right, low, high), qx, qy) < min(own, 20 * scale))
            # A joining line must cross neither another label nor another point.
            for share in (0.2, 0.4, 0.6, 0.8):
                sx, sy = px + share * (cx - px), py + share * (cy - py)
                if not (left < sx < right and low < sy < high):
                    cost += 20 * sum(l < sx < r and b < sy < t for l, r, b, t in taken)
                    cost += 4 * sum((qx, qy) != (px, py) and abs(qx - sx) + abs(qy - sy) < 8 * scale for qx, qy in points)
            if best is None or cost < best[0]:
                best = (cost, cx, cy, distance, (left, right, low, high))
        _, cx, cy, distance, box = best
        written.set_position(((cx - px) / scale, (cy - py) / scale))
        taken.append(box)
        if distance > gap + 6:
            ex, ey = min(max(px, box[0]), box[1]), min(max(py, box[2]), box[3])
            (x0, y0), (x1, y1) = axes.transData.inverted().transform([(px, py), (ex, ey)])
            axes.plot([x0, x1], [y0, y1], color=colour, linewidth=0.6, zorder=2, alpha=0.7)
