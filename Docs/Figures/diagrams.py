#!/usr/bin/env python3
"""Draws the diagrams of the documentation as SVG.

usage: diagrams.py [FOLDER [NAME...]]

The default folder is Docs/Pictures. Without names, the script draws every diagram. It writes the same bytes in each run.
Coordinates are points on the page, x to the right and y down. Text stays text, so that it can be searched. The layout
is that of DejaVu Sans. Most fonts that a viewer may use instead are narrower.
"""
import io
import math
import pathlib
import re
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "palpate", "font.family": "DejaVu Sans"})

import numpy as np
from matplotlib import patches, pyplot

# The palette of Okabe and Ito, which colour-blind readers can tell apart.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, RED, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY, DARK_GREY, PALE = "#666666", "#4D4D4D", "#E6E6E6"
RED_TEXT, GREEN_TEXT, ORANGE_TEXT = "#A84A00", "#00734F", "#8A5F00"  # the same, dark enough for text

WIDTH = 560
TITLE, LABEL, SMALL = 12.5, 10.5, 9.5  # sizes of text
THIN, LINE, STRONG = 0.8, 1.4, 2.6     # widths of lines
CENTRE = {"radius": 2.8, "fill": "white", "edge": BLACK, "width": THIN}  # how the centre of a box is drawn
FAMILIES = "'DejaVu Sans', Verdana, Arial, sans-serif"


def tint(colour, share=0.25):
    """The colour on white, with this share of it."""
    parts = [int(colour[i:i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(255 - share * (255 - part)):02X}" for part in parts)


class Page:
    """A white page with the drawing functions that all diagrams use."""

    def __init__(self, height, title):
        self.figure = pyplot.figure(figsize=(WIDTH / 72, height / 72), facecolor="white")
        self.axes = self.figure.add_axes([0, 0, 1, 1])
        self.axes.set(xlim=(0, WIDTH), ylim=(height, 0))
        self.axes.axis("off")
        self.text(16, 24, title, size=TITLE, weight="bold")

    def add(self, patch, order):
        patch.set(zorder=order, clip_on=False)
        self.axes.add_patch(patch)

    def text(self, x, y, lines, size=LABEL, color=BLACK, ha="left", weight="normal", leading=None):
        """Text whose first baseline is at y. Lines follow each other downwards."""
        for i, line in enumerate(lines.split("\n")):
            self.axes.text(x, y + i * (leading or 1.35 * size), line, size=size, color=color, ha=ha, va="baseline",
                           weight=weight, zorder=9)

    def line(self, *points, color=BLACK, width=LINE, dash=None, order=3):
        x, y = zip(*points)
        self.axes.plot(x, y, color=color, lw=width, ls=(0, dash) if dash else "-", zorder=order, clip_on=False,
                       solid_capstyle="round", solid_joinstyle="round", dash_capstyle="butt")

    def arrow(self, start, end, color=BLACK, width=LINE, dash=None, style="-|>", bend=0.0, order=5):
        self.add(patches.FancyArrowPatch(start, end, arrowstyle=style, mutation_scale=5 + 3.5 * width, color=color,
                                         lw=width, ls=(0, dash) if dash else "-", shrinkA=0, shrinkB=0, joinstyle="miter",
                                         connectionstyle=f"arc3,rad={bend}"), order)

    def polygon(self, points, fill="none", edge=BLACK, width=LINE, dash=None, order=2):
        self.add(patches.Polygon(points, closed=True, fc=fill, ec=edge, lw=width, ls=(0, dash) if dash else "-",
                                 joinstyle="round"), order)

    def box(self, x, y, width, height, fill="none", edge=BLACK, line=LINE, dash=None, order=2):
        """A box given by its upper left corner."""
        self.polygon([(x, y), (x + width, y), (x + width, y + height), (x, y + height)], fill, edge, line, dash, order)

    def card(self, x, y, width, height, fill="white", edge=GREY, line=LINE, order=2):
        """A box with round corners."""
        self.add(patches.FancyBboxPatch((x + 5, y + 5), width - 10, height - 10, boxstyle="round,pad=5,rounding_size=5",
                                        fc=fill, ec=edge, lw=line), order)

    def dot(self, centre, radius=3.2, fill=BLACK, edge="none", width=LINE, order=6):
        self.add(patches.Circle(centre, radius, fc=fill, ec=edge, lw=width), order)

    def measure(self, start, end, color=BLACK):
        """A dimension line with arrows at both ends."""
        self.arrow(start, end, color, THIN, style="<|-|>")

    def svg(self):
        buffer = io.StringIO()
        self.figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, facecolor="white")
        pyplot.close(self.figure)
        text = re.sub(r"\s*<metadata>.*?</metadata>", "", buffer.getvalue(), flags=re.S)
        text = text.replace("'DejaVu Sans'", FAMILIES)
        return "\n".join(line.rstrip() for line in text.split("\n"))


def inSpace(origin, scale, depth=(0.42, -0.3)):
    """A parallel projection: x to the right, y into the page, z up."""
    def project(point):
        x, y, z = point
        return (origin[0] + scale * (x + depth[0] * y), origin[1] + scale * (depth[1] * y - z))
    return project


def between(a, b, weight):
    return tuple(np.asarray(a) + weight * (np.asarray(b) - np.asarray(a)))


def shifted(point, x, y):
    return (point[0] + x, point[1] + y)


def contactColumn(page, fields, weights, columns):
    """The values of a contact and its stencil, in the right column."""
    x, y = 352, 56
    page.text(x, y, "Contact", weight="bold")
    for name, value in fields:
        y += 16
        page.text(x, y, name, size=SMALL)
        page.text(x + 78, y, value, size=SMALL)
    y += 28
    page.text(x, y, "stencil(contact)", weight="bold")
    for row in weights:
        y += 16
        for offset, cell in zip(columns, row):
            page.text(x + offset, y, cell, size=SMALL)
    page.text(x, y + 22, "sum of weight \u00b7 position\n= (distance + radii) \u00b7 normal", size=SMALL)


def normalAndDistance(page, foot, end, length, middle):
    """The dashed line between two closest points, its length, and the normal that starts at `foot`."""
    page.line(foot, end, color=GREY, dash=(4, 3))
    page.arrow(foot, shifted(foot, 0, -length), color=RED, width=STRONG)
    page.text(foot[0] + 10, foot[1] - length + 8, "normal", color=RED_TEXT)
    page.measure(shifted(foot, -14, 0), shifted(end, -14, 0))
    page.text(foot[0] - 20, middle, "distance", ha="right")


def vertexTriangle():
    page = Page(424, "A vertex-triangle contact")
    corners = np.array([[0.0, 0.0, 0.0], [4.2, 0.0, 0.0], [2.6, 4.6, 0.0]])
    weights = np.array([0.4, 0.2, 0.4])
    closest = weights @ corners
    at = inSpace((30, 264), 52, depth=(0.36, -0.46))
    a, b, c, foot, vertex = map(at, [*corners, closest, closest + [0, 0, 2.3]])

    page.polygon([a, b, c], fill=tint(BLUE), edge=BLUE)
    for corner in (a, b, c):
        page.line(foot, corner, color=BLUE, width=THIN, dash=(3, 3))
        page.dot(corner, fill=BLUE)
    page.text(a[0] - 4, a[1] + 19, "a, weight 0.4", color=BLUE)
    page.text(b[0] + 14, b[1] + 19, "b, weight 0.2", color=BLUE, ha="center")
    page.text(c[0] + 9, c[1] - 1, "c, weight 0.4", color=BLUE)
    normalAndDistance(page, foot, vertex, 52, vertex[1] + 50)
    page.dot(foot, fill="white", edge=BLACK)
    page.text(foot[0] + 10, foot[1] + 5, "closest point", size=SMALL)
    page.dot(vertex, radius=4.2, fill=ORANGE, order=7)
    page.text(vertex[0] + 10, vertex[1] - 4, "vertex p")

    contactColumn(page, [("vertex", "p"), ("corners", "{a, b, c}"), ("barycentric", "(0.4, 0.2, 0.4)"),
                         ("distance", "2.3"), ("normal", "from triangle to vertex"),
                         ("timeOfImpact", "time of these values")],
                  [("p", "1"), ("a", "\u22120.4"), ("b", "\u22120.2"), ("c", "\u22120.4")], (0, 78))

    page.line((16, 300), (WIDTH - 16, 300), color=PALE)
    page.text(16, 320, "Direction of the normal and sign of the distance", weight="bold")
    sides = [("Every method,", "vertex in front", -1, -1, "distance \u2265 0"),
             ("Proximity, Continuous,", "vertex behind", 1, 1, "distance \u2265 0"),
             ("Intersection,", "vertex behind", 1, -1, "distance < 0")]
    for i, (method, place, side, direction, sign) in enumerate(sides):
        left = 16 + 182 * i
        base = (left + 128, 373)
        page.text(left, 342, method, size=SMALL)
        page.text(left, 355, place, size=SMALL)
        page.text(left, 377, sign, size=SMALL, weight="bold")
        page.line((base[0] - 36, base[1]), (base[0] + 36, base[1]), color=BLUE, width=STRONG)
        page.line(base, shifted(base, 0, 24 * side), color=GREY, dash=(4, 3))
        page.dot(shifted(base, 0, 24 * side), radius=4.2, fill=ORANGE)
        start = base if side == direction else shifted(base, 0, 24)
        page.arrow(shifted(start, 12, 0), shifted(start, 12, 20 * direction), color=RED, width=STRONG)
    page.text(16, 414, "Here the triangle is seen from the side. Its front, to which the winding normal points, is up. "
              "All radii are 0.", size=SMALL, color=GREY)
    return page


def edgeEdge():
    page = Page(290, "An edge-edge contact")
    weightA, weightB, distance = 0.4, 0.7, 2.0
    alongA, alongB = np.array([4.6, 1.0, 0.0]), np.array([-0.3, 4.6, 0.0])
    lift = np.array([0, 0, distance])
    at = inSpace((150, 202), 52, depth=(0.5, -0.42))
    p0, p1, onA = at(lift - weightA * alongA), at(lift + (1 - weightA) * alongA), at(lift)
    q0, q1, onB = at(-weightB * alongB), at((1 - weightB) * alongB), at((0, 0, 0))

    page.line(p0, p1, color=BLUE, width=STRONG)
    page.line(q0, q1, color=ORANGE, width=STRONG)
    for point, colour in ((p0, BLUE), (p1, BLUE), (q0, ORANGE), (q1, ORANGE)):
        page.dot(point, radius=4.2, fill=colour)
    page.text(p0[0] - 6, p0[1] - 11, "p0, weight 0.6", color=BLUE)
    page.text(p1[0] + 6, p1[1] - 11, "p1, weight 0.4", color=BLUE, ha="right")
    page.text(q0[0] + 12, q0[1] + 5, "q0, weight 0.3", color=ORANGE_TEXT)
    page.text(q1[0] + 12, q1[1] + 5, "q1, weight 0.7", color=ORANGE_TEXT)
    page.text(p0[0] + 4, p0[1] + 20, "edge a", color=BLUE, weight="bold")
    middle = between(q0, onB, 0.45)
    page.text(middle[0] - 12, middle[1] + 2, "edge b", color=ORANGE_TEXT, weight="bold", ha="right")
    normalAndDistance(page, onB, onA, 52, onA[1] + 62)
    for point in (onA, onB):
        page.dot(point, fill="white", edge=BLACK)
    page.text(onA[0] + 8, onA[1] + 16, "p0 + 0.4 (p1 \u2212 p0)", size=SMALL)
    page.text(onB[0] + 12, onB[1] + 8, "q0 + 0.7 (q1 \u2212 q0)", size=SMALL)

    contactColumn(page, [("edgeA", "{p0, p1}"), ("edgeB", "{q0, q1}"), ("weightA", "0.4"), ("weightB", "0.7"),
                         ("distance", "2.0"), ("normal", "from edge b to edge a"),
                         ("timeOfImpact", "time of these values")],
                  [("p0", "0.6", "p1", "0.4"), ("q0", "\u22120.3", "q1", "\u22120.7")], (0, 24, 78, 102))
    return page


def wedge(page, tip, fill, edge, dash=None):
    """The end of a tool, a small triangle mesh seen from the side."""
    x, y = tip
    page.polygon([(x, y), (x - 13, y - 30), (x + 13, y - 30)], fill=fill, edge=edge, dash=dash, order=4)
    page.line((x, y), (x, y - 30), color=edge, width=THIN, dash=dash, order=4)


def tunnellingStep(page, middle, finds):
    """One step of the tool, and the first impact if the method finds it."""
    unit, surface, band = 25, 190, 12.5  # the tip moves from height 3 to height -2; the thickness is 0.5
    left = middle - 62
    page.box(left, surface - band, 124, 2 * band, fill=tint(SKY, 0.35), edge="none", line=0, order=1)
    page.line((left, surface), (left + 124, surface), color=BLUE, width=STRONG, order=2)
    for share in (0, 1, 2, 3):
        page.dot((left + 124 * share / 3, surface), radius=2.4, fill=BLUE, order=3)
    before, now = (middle, surface - 3 * unit), (middle, surface + 2 * unit)
    reported = {"fill": tint(ORANGE, 0.6), "edge": BLACK}
    other = {"fill": "white", "edge": GREY, "dash": (3, 2)}
    wedge(page, before, **other)
    wedge(page, now, **(other if finds else reported))
    page.arrow(shifted(before, 0, 2), shifted(now, 0, -31), color=GREY, dash=(3, 2), order=3)
    page.dot(before, fill=GREY)
    page.dot(now, fill=GREY if finds else BLACK)
    page.text(middle + 20, 108, "before", size=SMALL, color=GREY)
    page.text(middle + 20, 226, "now", size=SMALL, color=GREY if finds else BLACK)
    if not finds:
        return
    impact = (middle, surface - band)
    wedge(page, impact, **reported)
    page.dot(impact, fill=BLACK)
    page.arrow((middle + 24, surface), (middle + 24, surface - 30), color=RED, width=STRONG)
    page.text(middle + 31, 168, "normal", size=SMALL, color=RED_TEXT)
    page.text(middle - 18, 160, "time 0.5", size=SMALL, ha="right", weight="bold")


def methodsOnATunnellingStep():
    page = Page(422, "Four methods on one step in which a tool passes a membrane")
    columns = [
        ("Intersection", "tests the step's end", False, "The meshes do not\nintersect at the end.",
         "trusted = false", "The tool moved further\nthan the smallest height\nof a triangle."),
        ("Proximity", "tests the step's end", False, "No features are within\nthe thickness at the end.",
         "trusted = false", "The tool moved further\nthan the thickness."),
        ("Continuous", "tests the whole step", True, "The tip reaches the\nthickness at time 0.5.",
         "trusted = true", "if the step is free of\nintersections at its start\n(startedApart)."),
        ("Auto", "chooses Continuous here", True, "The same as Continuous,\nwith reason = Fast.",
         "trusted = true", "on the same condition.\nAuto checks it at once\nif it is unknown."),
    ]
    for i, (method, tests, finds, why, trusted, condition) in enumerate(columns):
        middle = 78 + 134.5 * i
        page.text(middle, 52, method, weight="bold", ha="center")
        page.text(middle, 66, tests, size=SMALL, ha="center", color=GREY)
        tunnellingStep(page, middle, finds)
        page.text(middle, 268, "Contact" if finds else "No contact", weight="bold", ha="center",
                  color=GREEN_TEXT if finds else RED_TEXT)
        page.text(middle, 284, why, size=SMALL, ha="center")
        page.text(middle, 320, trusted, weight="bold", ha="center", size=SMALL)
        page.text(middle, 334, condition, size=SMALL, ha="center")
    page.line((16, 376), (WIDTH - 16, 376), color=PALE)
    page.box(16, 389, 16, 10, fill=tint(SKY, 0.35), edge="none", line=0)
    page.line((16, 394), (32, 394), color=BLUE, width=STRONG)
    page.text(40, 397, "Membrane from the side, and the points within the thickness 0.5. "
              "Both geometries are triangle meshes.\nThe tip moves from height 3 to height \u22122. "
              "This is further than motionTolerance.", size=SMALL, color=GREY)
    return page


def cellsOfLevels(page, left, top):
    """Three triangles of different size, each in the cell of its level."""
    unit = 29

    def at(x, y):
        return (left + unit * x, top + unit * (8 - y))

    for x, y, edge in ((0, 0, 4), (0, 4, 2), (4, 4, 2), (6, 4, 1)):
        for k in range(3):
            page.line(at(x + k * edge, y), at(x + k * edge, y + 2 * edge), color=GREY, width=THIN, order=2)
            page.line(at(x, y + k * edge), at(x + 2 * edge, y + k * edge), color=GREY, width=THIN, order=2)
    for colour, edge, cell, corners in ((BLUE, 4, (4, 0), [(3.2, 0.7), (6.2, 1.4), (4.6, 3.3)]),
                                        (ORANGE, 2, (0, 4), [(0.6, 4.9), (2.3, 5.4), (1.1, 6.3)]),
                                        (PURPLE, 1, (7, 4), [(6.8, 4.5), (7.4, 4.35), (7.5, 5.1)])):
        x, y = zip(*corners)
        page.box(*at(cell[0], cell[1] + edge), unit * edge, unit * edge, fill=tint(colour), edge=colour, order=1)
        page.box(*at(min(x), max(y)), unit * (max(x) - min(x)), unit * (max(y) - min(y)), line=THIN, order=4)
        page.polygon([at(*corner) for corner in corners], fill=colour, edge=colour, order=3)
        page.dot(at((min(x) + max(x)) / 2, (min(y) + max(y)) / 2), **CENTRE)


def boundsOfNode(page, centre, cell):
    """A node's cell, loose bounds and fitted box around three triangles."""
    corner = shifted(centre, -cell / 2, -cell / 2)
    page.box(*shifted(centre, -cell, -cell), 2 * cell, 2 * cell, edge=BLUE, dash=(5, 3), order=3)
    page.box(*corner, cell, cell, fill=tint(BLUE), edge=BLUE, line=STRONG, order=1)
    triangles = [[(-78, -52), (-4, -70), (-14, -4)], [(-10, -8), (58, -22), (40, 60)], [(-30, 14), (-4, 34), (-34, 38)]]
    x, y = zip(*(shifted(centre, *point) for points in triangles for point in points))
    page.box(min(x), min(y), max(x) - min(x), max(y) - min(y), edge=RED, line=STRONG, order=5)
    for points in triangles:
        u, v = zip(*points)
        page.polygon([shifted(centre, *point) for point in points], fill=tint(GREY, 0.7), edge=GREY, order=3)
        page.dot(shifted(centre, (min(u) + max(u)) / 2, (min(v) + max(v)) / 2), **CENTRE)
    page.measure(shifted(corner, 0, cell + 26), shifted(corner, cell, cell + 26))
    page.text(centre[0], corner[1] + cell + 39, "s", ha="center")
    page.measure(shifted(centre, -cell, cell + 12), shifted(centre, cell, cell + 12))
    page.text(centre[0], centre[1] + cell + 27, "2 s", ha="center")


def cellsAndBoxes():
    page = Page(416, "Cell, loose bounds and fitted box, in the plane")
    left, right = 16, 296
    page.text(left, 50, "1. The cell of a triangle", weight="bold")
    cellsOfLevels(page, left + 1, 64)
    for k, (colour, name) in enumerate(((BLUE, "level 1"), (ORANGE, "level 2"), (PURPLE, "level 3"))):
        page.box(left + 78 * k, 308, 11, 11, fill=tint(colour), edge=colour)
        page.text(left + 17 + 78 * k, 317.5, name, size=SMALL)
    page.box(left, 326, 11, 11, line=THIN)
    page.dot((left + 5.5, 331.5), **CENTRE)
    page.text(left + 17, 335, "box of a triangle, and its centre", size=SMALL)
    page.text(left, 357, "The cell holds the centre of the box. Its level\nis the deepest whose cells are not smaller\n"
              "than the longest side of the box.", size=SMALL)
    page.text(left, 396, "A leaf also holds the triangles of smaller cells.", size=SMALL)

    page.text(right, 50, "2. The bounds of a node", weight="bold")
    boundsOfNode(page, (416, 172), 92)
    legend = [(BLUE, STRONG, None, "cell, with the edge s"), (BLUE, LINE, (5, 3), "loose bounds: the doubled cell"),
              (RED, STRONG, None, "fitted box: the smallest around its triangles")]
    for k, (colour, width, dash, name) in enumerate(legend):
        page.line((right, 314 + 18 * k), (right + 20, 314 + 18 * k), color=colour, width=width, dash=dash)
        page.text(right + 27, 317.5 + 18 * k, name, size=SMALL)
    page.text(right, 376, "The fitted box holds the triangles always, the\n"
              "loose bounds hold them after a rebuild.", size=SMALL)
    return page


def frame():
    page = Page(635, "The way of a frame")
    x, width, height, pitch = 16, 316, 40, 61
    stages = [
        ("1  Positions", "CollisionDetection",
         "setPositions() checks and copies the positions now", "positions before and now"),
        ("2  Plan", "Validity",
         "chooses Auto's method: the step's end, or the whole step", "what the boxes must enclose"),
        ("3  Boxes", "Mesh",
         "one float box for each element, rounded outward", "boxes of elements"),
        ("4  Loose octrees", "Octree",
         "refit or rebuild, one octree for each geometry", "cells with fitted boxes"),
        ("5  Pairs", "Octree",
         "descends two octrees together", "element pairs (candidates)"),
        ("6  Feature pairs", "NarrowPhase",
         "pairs of owned vertices and edges, each tested once", "vertex-triangle and edge-edge pairs"),
        ("7  Contacts", "NarrowPhase",
         "distance, time of impact or intersection", "contacts"),
        ("8  Order and trust", "CollisionDetection, Validity",
         "sorts by element ids, decides what is trusted", "CollisionData"),
    ]

    def handOver(top, data):
        page.arrow((x + 24, top), (x + 24, top + 20))
        page.text(x + 36, top + 14, data, size=SMALL)

    def userCard(left, top, cardWidth, name, note):
        page.card(left, top, cardWidth, 34, fill=tint(ORANGE), edge=ORANGE)
        page.text(left + 12, top + 21, name, weight="bold")
        page.text(left + cardWidth - 12, top + 21, note, size=SMALL, ha="right")

    userCard(x, 42, width, "Your arrays", "positions in each step")
    handOver(76.5, "positions")
    tops = [97 + pitch * k for k in range(len(stages))]
    for top, (name, module, work, data) in zip(tops, stages):
        page.card(x, top, width, height, fill=tint(SKY, 0.3), edge=BLUE)
        page.text(x + 12, top + 16, name, weight="bold")
        page.text(x + width - 12, top + 16, module, size=SMALL, ha="right", color=DARK_GREY)
        page.text(x + 12, top + 32, work, size=SMALL)
        handOver(top + height + 0.5, data)
    userCard(x, tops[-1] + pitch, width, "Your solver", "stencils or constraint rows")

    right, side = x + width, 392
    page.card(side, tops[3] - 4, 152, 62, fill=tint(GREEN), edge=GREEN)
    page.text(side + 12, tops[3] + 13, "Queries", weight="bold")
    page.text(side + 12, tops[3] + 29, "inside vertices, surface\npoints, tetrahedra", size=SMALL)
    page.arrow((right + 1, tops[3] + 20), (side - 1, tops[3] + 20))
    page.arrow((side + 24, tops[3] + 58), (side + 24, tops[4] + 29))
    page.text(side + 36, tops[4] + 18, "results", size=SMALL)
    userCard(side, tops[4] + 30, 152, "Your program", "")

    first, second = tops[4] + 30, tops[6] + 20
    page.line((right + 1, first), (right + 22, first), (right + 22, second), (right + 12, second), color=GREY,
              dash=(4, 3))
    page.arrow((right + 12, second), (right + 1, second), color=GREY)
    page.text(right + 29, tops[6] - 4, "Intersection tests pairs\nof triangles directly.", size=SMALL, color=DARK_GREY)
    page.text(side, tops[0] + 16, "The names at the right of the\nboxes are modules of Source.", size=SMALL,
              color=DARK_GREY)
    return page


def edgeOf(a, b):
    return (min(a, b), max(a, b))


def ownersOf(triangles):
    """The owners of vertices and of edges: the lowest triangle that holds each."""
    vertices, edges = {}, {}
    for number in sorted(triangles):
        a, b, c = triangles[number]
        for vertex in (a, b, c):
            vertices.setdefault(vertex, number)
        for edge in (edgeOf(a, b), edgeOf(b, c), edgeOf(c, a)):
            edges.setdefault(edge, number)
    return vertices, edges


def featureOwnership():
    page = Page(384, "One triangle owns each vertex and each edge")
    page.text(16, 48, "The owner of a vertex or edge is the enabled triangle with the lowest index that holds it.",
              size=SMALL)
    numbers = [3, 0, 4, 1, 5, 2]  # of the triangles, around the centre
    colours = [BLUE, ORANGE, GREEN, PURPLE, SKY, RED]
    centre, radius = (164, 206), 128
    places = [centre] + [shifted(centre, radius * math.cos(angle), -radius * math.sin(angle))
                         for angle in (math.radians(60 * k) for k in range(6))]
    triangles = {numbers[k]: (0, 1 + k, 1 + (k + 1) % 6) for k in range(6)}
    vertexOwners, edgeOwners = ownersOf(triangles)
    middles = {number: np.mean([places[v] for v in corners], axis=0) for number, corners in triangles.items()}

    for number, corners in triangles.items():
        page.polygon([places[v] for v in corners], fill=tint(colours[number], 0.3), edge="none", width=0, order=1)
        page.text(middles[number][0], middles[number][1] + 5, str(number), ha="center", size=TITLE, weight="bold")
    for (a, b), owner in edgeOwners.items():
        start, end, middle = places[a], places[b], between(places[a], places[b], 0.5)
        inward = middles[owner] - np.asarray(middle)
        offset = 3.2 * inward / np.linalg.norm(inward)
        page.line(start, end, width=THIN, order=2)
        page.line(shifted(between(start, end, 0.12), *offset), shifted(between(start, end, 0.88), *offset),
                  color=colours[owner], width=1.6 * STRONG, order=3)
        page.dot(shifted(middle, *offset), radius=7, fill="white", edge=colours[owner], order=4)
        page.text(middle[0] + offset[0], middle[1] + offset[1] + 3.4, str(owner), size=SMALL, ha="center")
    for vertex, owner in vertexOwners.items():
        page.dot(places[vertex], radius=11, fill=tint(colours[owner], 0.6), edge=BLACK)
        page.text(places[vertex][0], places[vertex][1] + 4, str(owner), ha="center", weight="bold")

    x, columns = 336, (20, 96, 158)
    page.text(x, 86, "Owned by each triangle", weight="bold")
    for number in range(6):
        y = 106 + 18 * number
        held = [list(owners.values()).count(number) for owners in (vertexOwners, edgeOwners)]
        page.box(x, y - 10, 12, 12, fill=tint(colours[number], 0.3), edge=colours[number])
        cells = (f"triangle {number}", f"{held[0]} vertices", f"{held[1]} edge" + "s" * (held[1] != 1))
        for offset, cell in zip(columns, cells):
            page.text(x + offset, y, cell, size=SMALL)
    page.line((x, 204), (x + 208, 204), color=GREY, width=THIN)
    for offset, cell in zip(columns, ("together", f"{len(vertexOwners)} vertices", f"{len(edgeOwners)} edges")):
        page.text(x + offset, 219, cell, size=SMALL)
    page.text(x, 256, "A pair of triangles (A, B) tests", weight="bold")
    page.text(x, 274, "\u2022  owned vertices of A against triangle B\n\u2022  owned vertices of B against triangle A\n"
              "\u2022  owned edges of A against those of B", size=SMALL, leading=16)
    page.text(x, 326, "So each feature pair is tested once.", size=SMALL)
    page.dot((27, 363), radius=11, fill=tint(GREY, 0.2), edge=BLACK)
    page.text(27, 367, "n", ha="center", weight="bold")
    page.text(46, 366.5, "vertex that triangle n owns", size=SMALL)
    page.line((216, 363), (252, 363), color=GREY, width=1.6 * STRONG)
    page.dot((234, 363), radius=7, fill="white", edge=GREY)
    page.text(234, 366.4, "n", size=SMALL, ha="center")
    page.text(260, 366.5, "edge that triangle n owns, drawn on the owner's side", size=SMALL)
    return page


def nearestOn(line, point):
    """The nearest point of a polyline, and its distance."""
    found = []
    for a, b in zip(np.asarray(line, float), np.asarray(line[1:], float)):
        share = np.clip(np.dot(point - a, b - a) / np.dot(b - a, b - a), 0, 1)
        foot = a + share * (b - a)
        found.append((float(np.linalg.norm(point - foot)), tuple(foot)))
    return min(found)


def surfaceInBand(page, points, thickness):
    x, y = zip(*points)
    page.axes.plot(x, y, color=tint(SKY, 0.35), lw=2 * thickness, zorder=1, solid_capstyle="round",
                   solid_joinstyle="round")
    page.line(*points, color=BLUE, width=STRONG, order=3)
    for point in points:
        page.dot(point, radius=2.4, fill=BLUE, order=4)


def contactLabel(page, at, label, isContact):
    page.text(*at, label, size=SMALL, ha="center", color=RED_TEXT if isContact else BLACK,
              weight="bold" if isContact else "normal")


def verticesAtMesh(page, thickness):
    points = [(54, 184), (120, 152), (186, 168), (232, 196)]
    surfaceInBand(page, points, thickness)
    for vertex, labelAt in (((92, 140), (92, 129)), ((176, 92), (176, 82)), ((146, 182), (146, 200)),
                            ((80, 238), (80, 255))):
        distance, foot = nearestOn(points, np.asarray(vertex, float))
        isContact = distance <= thickness
        colour = RED if isContact else GREY
        page.line(vertex, foot, color=colour, dash=None if isContact else (3, 3), order=4)
        page.dot(vertex, radius=4.2, fill=RED if isContact else "white", edge=colour)
        contactLabel(page, labelAt, "contact" if isContact else "no contact", isContact)
    along = np.asarray(points[3], float) - points[2]
    across = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    foot = between(points[2], points[3], 0.45)
    page.measure(foot, shifted(foot, *(thickness * across)))
    page.text(226, 152, "thickness", size=SMALL)


def threadsAtMesh(page, thickness):
    level, radius, left, right = 196, 18, 334, 512
    surfaceInBand(page, [(left, level), (left + 90, level), (left + 150, level), (right, level)], thickness)
    reach = level - thickness - radius
    page.line((left - 34, reach), (right + 32, reach), color=BLUE, width=THIN, dash=(5, 3), order=1)
    page.measure((360, level), (360, level - thickness))
    page.measure((360, level - thickness), (360, reach))
    page.text(355, level - 14, "thickness", size=SMALL, ha="right")
    page.text(355, reach + 12, "radius", size=SMALL, ha="right")
    for middle, gap, label in ((390, -8, "contact,\ndistance < 0"), (466, 17, "contact,\ndistance > 0"),
                               (512, 46, "no contact")):
        isContact = gap <= thickness
        colour = RED if isContact else GREY
        centre = (middle, level - gap - radius)
        page.dot(centre, radius=radius, fill=tint(ORANGE, 0.35), order=2)
        page.dot(centre, radius=radius, fill="none", edge=colour, order=5)
        page.dot(centre, radius=2.8, fill=colour)
        if gap > 0:
            page.line((middle, level - gap), (middle, level), color=colour, dash=None if isContact else (3, 3), order=4)
        contactLabel(page, (middle, level + 48 if isContact else centre[1] - radius - 9), label, isContact)


def contactDistance():
    page = Page(362, "Contact distance: PairSettings::thickness, the d-hat of IPC")
    thickness = 34
    page.text(16, 50, "Vertices and a mesh", weight="bold")
    verticesAtMesh(page, thickness)
    page.text(16, 284, "Features at most the thickness apart are\ncontacts. Both sides of the mesh count,\n"
              "unless it has Sidedness::Outer.", size=SMALL)
    page.text(296, 50, "A thread with a radius and a mesh", weight="bold")
    threadsAtMesh(page, thickness)
    page.text(296, 284, "Radii add to the thickness. A contact's distance is\n"
              "that of the centre line less the radius. It is\n"
              "negative where the thread overlaps the surface.", size=SMALL)
    page.line((16, 326), (WIDTH - 16, 326), color=PALE)
    page.box(16, 339, 16, 10, fill=tint(SKY, 0.35), edge="none", line=0)
    page.line((16, 344), (32, 344), color=BLUE, width=STRONG)
    page.text(40, 347.5, "mesh from the side, and the points within the thickness", size=SMALL, color=GREY)
    return page


def stateMachine(page):
    """What the library knows of the start of a step, and how it comes to know it."""
    page.card(206, 66, 148, 46, fill=tint(GREY), edge=GREY)
    page.text(280, 85, "start unknown", weight="bold", ha="center", size=SMALL)
    page.text(280, 101, "startedApart = false", size=SMALL, ha="center")
    page.card(16, 226, 160, 46, fill=tint(GREEN), edge=GREEN)
    page.text(96, 245, "start free of intersections", weight="bold", ha="center", size=SMALL)
    page.text(96, 261, "startedApart = true", size=SMALL, ha="center")
    page.card(384, 226, 160, 46, fill=tint(RED), edge=RED)
    page.text(464, 245, "start in intersection", weight="bold", ha="center", size=SMALL)
    page.text(464, 261, "startedApart = false", size=SMALL, ha="center")

    page.arrow((16, 89), (205, 89))
    page.text(16, 82, "pair added, or topology changed", size=SMALL)
    page.arrow((222, 113), (74, 225), color=GREEN)
    page.text(16, 134, "The initial intersection check,\nor Intersection at rest,\nfinds no intersection.", size=SMALL)
    page.arrow((338, 113), (486, 225), color=RED)
    page.text(544, 134, "The initial intersection check,\nor Intersection,\nfinds an intersection.", size=SMALL,
              ha="right")
    page.arrow((132, 225), (258, 113), color=GREY, dash=(4, 3))
    page.arrow((428, 225), (302, 113), color=GREY, dash=(4, 3))
    page.text(280, 166, "The step leaves\nthe end unknown.", size=SMALL, ha="center", color=DARK_GREY)
    page.arrow((177, 240), (383, 240), color=RED)
    page.text(280, 221, "Triangles are found to\nintersect at the end.", size=SMALL, ha="center")
    page.arrow((383, 258), (177, 258), color=GREEN)
    page.text(280, 274, "Auto finds no intersection\nat the end (no restDistance).", size=SMALL, ha="center")
    for middle, colour, label in ((96, GREEN, "The motion or the impacts\nexclude an intersection."),
                                  (464, RED, "Triangles still intersect.")):
        page.arrow((middle - 24, 273), (middle + 24, 273), color=colour, bend=0.9)
        page.text(middle, 312, label, size=SMALL, ha="center")


def conditions(page, y, rows):
    """A table of names and conditions."""
    for k, (name, condition) in enumerate(rows):
        page.text(16, y + 16 * k, name, size=SMALL, weight="bold")
        page.text(104, y + 16 * k, condition, size=SMALL)


def validityStates():
    page = Page(698, "Validity of an answer")
    page.text(16, 48, "1. What is known of a step's start, carried from step to step", weight="bold")
    stateMachine(page)
    conditions(page, 348, [
        ("Initial check", "Auto runs it if the start is unknown. Proximity and Continuous run it at most once"),
        ("", "in 16 frames on average. Intersection never runs it, nor does Proximity if displacement"),
        ("", "exceeds the thickness."),
        ("Dashed arrows", "Proximity's features may have touched or were not examined, or Intersection moved and"),
        ("", "found nothing, or impacts come with earliestTimeOnly, a predicate, restDistance or"),
        ("", "Sidedness::Outer, or before is further from the last step's end than the bounds allow."),
    ])
    page.line((16, 444), (WIDTH - 16, 444), color=PALE)
    page.text(16, 466, "2. Conditions of trusted = true", weight="bold")
    conditions(page, 486, [
        ("Every method", "two triangle or tetrahedral meshes; not separated by groups; arcDeviation \u2264 thickness"),
        ("Continuous", "startedApart"),
        ("Proximity", "startedApart; displacement \u2264 thickness; no features may have touched in the step"),
        ("Auto", "startedApart, or answered by Intersection at rest without a thickness"),
        ("Intersection", "nothing moved; or displacement \u2264 smallest height of a triangle, and triangles"),
        ("", "intersect at the end, or no boxes of triangles are within displacement there"),
    ])
    page.card(16, 582, 336, 100, fill=tint(GREEN), edge=GREEN)
    page.text(28, 599, "trusted = true", weight="bold")
    page.text(28, 615, "Proximity, Continuous, Auto: normals are on the side from\nwhich features came. "
              "No touch within the step is missing,\nsave those that Distinct or filters drop.\n"
              "Intersection: if the meshes touched within the step, the\nanswer is not empty. "
              "Its normals are never certified.", size=SMALL)
    page.card(368, 582, 176, 100, fill=tint(RED), edge=RED)
    page.text(380, 599, "trusted = false", weight="bold")
    page.text(380, 615, "The answer may be right or\nwrong: the library does not\nknow.", size=SMALL)
    return page


def validityActions():
    """What a user does for each cause of HowTo/Validity.md."""
    rows = [
        (GREEN, "trusted = true", "no touch is missing, sides are right", "Use the answer."),
        (ORANGE, "Proximity, Intersection, Continuous", "the method cannot exclude a touch",
         "Detect the same step again with Auto,\nbefore advance()."),
        (RED, "Auto, and the step begins in touch", "the surfaces touch or intersect",
         "Nothing, if they only touch. Otherwise\nrecover the surfaces: see below."),
        (ORANGE, "A body turned too far", "its arcs leave the thickness", "Take shorter steps or a larger thickness."),
        (ORANGE, "Neighbours are not welded", "copies of a vertex tear a surface", "Call weld() once, when you load the mesh."),
        (ORANGE, "Two shapes met without a side", "there is no thickness", "Set a thickness."),
        (GREY, "Distance field or proxy; separated groups", "the answer is as you asked for it",
         "Nothing: the error bound holds, or nothing\nwas tested."),
    ]
    page = Page(46 + 50 * len(rows), "What you do for each state of an answer")
    for k, (colour, state, meaning, action) in enumerate(rows):
        top = 44 + 50 * k
        page.card(16, top, 270, 42, fill=tint(colour), edge=colour)
        page.text(28, top + 17, state, weight="bold")
        page.text(28, top + 32, meaning, size=SMALL)
        page.arrow((287, top + 21), (316, top + 21), color=colour)
        page.text(324, top + (25 if "\n" not in action else 18), action)
    return page


def snapshots():
    page = Page(292, "A simulation at 60 Hz, a haptic loop at 1 kHz")
    left, step, count = 96, 108, 4
    simulation, shared, haptic = 66, 140, 214
    colours = (BLUE, GREEN, ORANGE, PURPLE)

    def at(frame):
        return left + step * frame

    for top, name, note in ((simulation, "Simulation", "computes a step"), (shared, "Snapshots", "immutable"),
                            (haptic, "Haptic loop", "ticks of 1 ms")):
        page.text(16, top + 12, name, weight="bold")
        page.text(16, top + 26, note, size=SMALL, color=GREY)
    for frame in range(count):
        colour = colours[frame]
        page.card(at(frame) + 2, simulation, 70, 30, fill=tint(colour), edge=colour)
        page.text(at(frame) + 37, simulation + 19, f"step {frame + 1}", ha="center")
        if frame == count - 1:
            break
        published = at(frame) + 84
        page.line((at(frame) + 73, simulation + 15), (published, simulation + 15), color=colour)
        end = min(published + 2 * step - 24, WIDTH - 16)
        lane = shared + 22 * (frame % 2)
        page.box(published - 8, lane, end - published + 8, 18, fill=tint(colour, 0.4), edge=colour, line=THIN)
        page.text(published, lane + 13, f"snapshot {frame + 1}", size=SMALL)
        page.arrow((published, simulation + 15), (published, lane - 1), color=colour)
    page.text(at(0) + 90, simulation + 44, "publish()", size=SMALL, color=DARK_GREY)
    for frame in range(3):
        colour = colours[frame]
        first = at(frame + 1) + 2
        page.box(first, haptic, step - 2, 30, fill=tint(colour), edge="none", line=0, order=1)
        for tick in range(16):
            x = first + (tick + 0.5) * (step - 2) / 16
            page.line((x, haptic + 4), (x, haptic + 26), color=colour)
        page.text(first + (step - 2) / 2, haptic + 45, f"plays step {frame + 1}", size=SMALL, ha="center")
        page.arrow((first + 8, shared + (18 if frame % 2 == 0 else 40) + 1), (first + 8, haptic - 1), color=colour,
                   order=1)
    page.text(at(1) + 18, haptic - 6, "latestSnapshot()", size=SMALL, color=DARK_GREY)
    page.text(16, 282, "A snapshot lives as long as a reader holds it. Its memory then returns to a later publish().",
              size=SMALL, color=GREY)
    return page


DIAGRAMS = {
    "VertexTriangle": vertexTriangle,
    "EdgeEdge": edgeEdge,
    "MethodsOnATunnellingStep": methodsOnATunnellingStep,
    "CellsAndBoxes": cellsAndBoxes,
    "Frame": frame,
    "FeatureOwnership": featureOwnership,
    "ContactDistance": contactDistance,
    "ValidityActions": validityActions,
    "ValidityStates": validityStates,
    "Snapshots": snapshots,
}


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent / "Pictures")
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or DIAGRAMS:
        (folder / f"{name}.svg").write_text(DIAGRAMS[name]().svg(), encoding="utf-8")


if __name__ == "__main__":
    main()
