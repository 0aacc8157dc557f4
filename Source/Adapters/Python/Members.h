#pragma once

#include "Python/Arrays.h"

namespace palpate::python {

/// An object of one of the package's Python modules, such as a class. It is looked up once for each
/// tag, so that a tag stands for one object.
template <class Tag>
py::handle lookedUp(const char* module, const char* name) {
  static PyObject* object = nullptr;  // guarded by the GIL; a guard of C++ could wait for it
  if (object == nullptr) object = py::getattr(py::module_::import(module), name).release().ptr();
  return object;
}

}  // namespace palpate::python
