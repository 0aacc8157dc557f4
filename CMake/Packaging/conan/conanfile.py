"""Conan 2 recipe of the copy of Palpate that it lies in: `conan create CMake/Packaging/conan`."""

import os

from conan import ConanFile
from conan.tools.build import check_min_cppstd
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy
from conan.tools.gnu import PkgConfigDeps


class Palpate(ConanFile):
    name = "palpate"
    version = "0.1.0"
    description = "Collision detection for surgical simulation"
    license = "Apache-2.0"
    settings = "os", "compiler", "build_type", "arch"
    options = {"shared": [True, False], "fPIC": [True, False]}
    default_options = {"shared": False, "fPIC": True}
    implements = ["auto_shared_fpic"]

    def export_sources(self):
        root = os.path.join(self.recipe_folder, "..", "..", "..")
        for pattern in ("CMakeLists.txt", "LICENSE", "CMake/*", "Source/*"):
            copy(self, pattern, root, self.export_sources_folder)

    def layout(self):
        cmake_layout(self)

    def requirements(self):
        self.requires("eigen/3.4.0", transitive_headers=True)
        self.requires("highway/1.0.3")
        self.requires("gmp/6.3.0")

    def build_requirements(self):
        self.tool_requires("pkgconf/[>=2]")

    def validate(self):
        check_min_cppstd(self, 20)

    def generate(self):
        CMakeDeps(self).generate()
        PkgConfigDeps(self).generate()
        toolchain = CMakeToolchain(self)
        for part in ("WITH_SIMPLIFY", "WITH_VTK", "WITH_FCL", "WITH_PYTHON", "BUILD_TESTING", "BUILD_EXAMPLES"):
            toolchain.cache_variables["PALPATE_" + part] = False
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))

    def package_info(self):
        self.cpp_info.set_property("cmake_file_name", "Palpate")
        core = self.cpp_info.components["core"]
        core.set_property("cmake_target_name", "Palpate::Palpate")
        core.set_property("pkg_config_name", "palpate")
        core.libs = ["Palpate"]
        core.requires = ["eigen::eigen", "highway::highway", "gmp::gmp"]
        if self.settings.os in ("Linux", "FreeBSD"):
            core.system_libs = ["pthread", "m"]
        files = self.cpp_info.components["meshfiles"]
        files.set_property("cmake_target_name", "Palpate::MeshFiles")
        files.libs = ["PalpateMeshFiles"]
        files.requires = ["core"]
