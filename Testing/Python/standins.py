"""Stand-ins for packages that the how-to pages use and that need not be installed.

Each has the calls of the pages only, and just enough behaviour to run them.
"""

import importlib.util
import sys
import types

import numpy as np


def module(name, **members):
    made = types.ModuleType(name)
    vars(made).update(members)
    return made


# SOFA: nodes with objects whose data have a value; vertices are free masses.


class Data:
    def __init__(self, value):
        self.value = np.array(value) if isinstance(value, list) else value


class SofaObject:
    def __init__(self, **data):
        self.name = data.pop("name", "")
        for key, value in data.items():
            setattr(self, key, Data(value))


class SofaNode:
    def __init__(self, name):
        self.name, self.children, self.controllers, self.mass = name, [], [], 0.0
        self.gravity, self.dt = Data([0.0, 0.0, 0.0]), Data(0.01)

    def addChild(self, name):
        self.children.append(SofaNode(name))
        setattr(self, name, self.children[-1])
        return self.children[-1]

    def addObject(self, kind, **data):
        if not isinstance(kind, str):
            self.controllers.append(kind)
            return kind
        made = SofaObject(**data)
        if kind == "UniformMass":
            self.mass = made.totalMass.value
        setattr(self, made.name or kind, made)
        return made


def animate(root, dt):
    for controller in root.controllers:
        controller.onAnimateBeginEvent(None)
    for node in root.children:
        if node.mass > 0:
            position = node.dofs.position.value.astype(float)
            velocity = getattr(node, "velocity", np.zeros_like(position))
            vertex_mass = node.mass / len(position)
            acceleration = root.gravity.value + node.contacts.forces.value / vertex_mass
            node.velocity = velocity + dt * acceleration
            node.dofs.position.value = position + dt * node.velocity


def init(root):
    for controller in root.controllers:
        controller.onSimulationInitDoneEvent(None)


def sofa():
    return module(
        "Sofa",
        Core=module("Sofa.Core", Controller=SofaObject, Node=SofaNode),
        Simulation=module("Sofa.Simulation", init=init, animate=animate),
    )


# MuJoCo: two flexes, sheets of 4 x 4 vertices. The second does not move.


class MjModel:
    @staticmethod
    def from_xml_string(text):
        assert text.count("<flexcomp") == 2
        model = MjModel()
        g = np.arange(16).reshape(4, 4)
        quads = [g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]]
        a, b, c, d = (each.ravel() for each in quads)
        elements = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        model.nflex = 2
        model.flex_dim, model.flex_vertnum = np.array([2, 2]), np.array([16, 16])
        model.flex_vertadr, model.flex_elemnum = np.array([0, 16]), np.full(2, len(elements))
        model.flex_elemdataadr = np.array([0, elements.size])
        model.flex_elem = np.concatenate([elements.ravel(), elements.ravel()])
        model.flex_vertbodyid = np.concatenate([1 + np.arange(16), np.zeros(16, dtype=int)])
        return model


class MjData:
    def __init__(self, model):
        x, y = np.divmod(np.arange(16), 4)
        sheet = np.stack([x - 1.5, y - 1.5, 0 * x], axis=1)
        self.qpos = np.concatenate([0.1 * sheet + [0.02, 0.03, 0.05], 0.15 * sheet])
        self.qvel = np.zeros((32, 3))
        self.flexvert_xpos = np.zeros((32, 3))
        self.xfrc_applied = np.zeros((17, 6))


def mj_step1(model, data):
    data.flexvert_xpos[:] = data.qpos


def mj_step2(model, data):
    force = data.xfrc_applied[model.flex_vertbodyid[:16], :3]
    data.qvel[:16] += 0.001 * (force / 0.01 + [0, 0, -9.81])
    data.qpos[:16] += 0.001 * data.qvel[:16]


def mujoco():
    steps = {"mj_forward": mj_step1, "mj_step1": mj_step1, "mj_step2": mj_step2}
    return module("mujoco", MjModel=MjModel, MjData=MjData, **steps)


# trimesh and meshio: mesh objects.


class Trimesh:
    def __init__(self, vertices, faces):
        self.vertices, self.faces = np.asarray(vertices, dtype=float), np.asarray(faces)

    def apply_translation(self, translation):
        self.vertices = self.vertices + translation


def box(extents):
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Trimesh(np.array(corners) * np.array(extents) / 2, faces)


def trimesh():
    return module("trimesh", Trimesh=Trimesh, creation=module("trimesh.creation", box=box))


class Mesh:
    def __init__(self, points, cells):
        self.points = np.array(points, dtype=float)
        self.cells = [types.SimpleNamespace(type=kind, data=np.array(ids)) for kind, ids in cells]


def meshio():
    return module("meshio", Mesh=Mesh)


STANDINS = {"Sofa": sofa, "mujoco": mujoco, "trimesh": trimesh, "meshio": meshio}


def install(monkeypatch):
    """Puts a stand-in in the place of each package that is not installed."""
    for name, make in STANDINS.items():
        if importlib.util.find_spec(name) is None:
            monkeypatch.setitem(sys.modules, name, make())
