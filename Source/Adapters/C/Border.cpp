#include "C/Border.h"

#include <palpate/Error.h>

#include <cstdio>
#include <new>

namespace palpate::c {

static_assert(PALPATE_NON_FINITE_POSITION == static_cast<int>(ErrorCode::NonFinitePosition) + 1);
static_assert(PALPATE_CANCELLED == static_cast<int>(ErrorCode::Cancelled) + 1);
static_assert(PALPATE_NO_ELEMENT == kNoElement);

namespace {

struct LastError {
  char text[1024];
  std::uint32_t geometry;
  std::size_t element;
};
constinit thread_local LastError lastError{"", PALPATE_NO_ELEMENT, SIZE_MAX};

palpate_status keep(palpate_status status, const char* function, const char* sentence,
                    std::uint32_t geometry = PALPATE_NO_ELEMENT, std::size_t element = SIZE_MAX) {
  std::snprintf(lastError.text, sizeof lastError.text, "%s(): %s", function, sentence);
  lastError.geometry = geometry;
  lastError.element = element;
  return status;
}

}  // namespace

palpate_status failed(const char* function) noexcept {
  try {
    throw;
  } catch (const Error& error) {
    const auto geometry = error.geometry();
    return keep(static_cast<palpate_status>(static_cast<int>(error.code()) + 1), function,
                error.what(), geometry ? static_cast<std::uint32_t>(*geometry) : PALPATE_NO_ELEMENT,
                error.element().value_or(SIZE_MAX));
  } catch (const InvalidArgument& error) {
    return keep(PALPATE_INVALID_ARGUMENT, function, error.what());
  } catch (const std::bad_alloc&) {
    return keep(PALPATE_OUT_OF_MEMORY, function, "The system gives no more memory.");
  } catch (const std::exception& error) {
    return keep(PALPATE_UNEXPECTED, function, error.what());
  } catch (...) {
    return keep(PALPATE_UNEXPECTED, function, "An exception of an unknown type.");
  }
}

}  // namespace palpate::c

using namespace palpate;

const char* palpate_version() { return PALPATE_VERSION; }

const char* palpate_status_name(palpate_status status) {
  switch (static_cast<int>(status)) {
    case PALPATE_OK:
      return "Ok";
    case PALPATE_INVALID_ARGUMENT:
      return "InvalidArgument";
    case PALPATE_OUT_OF_MEMORY:
      return "OutOfMemory";
    case PALPATE_UNEXPECTED:
      return "Unexpected";
    default:
      return toString(static_cast<ErrorCode>(static_cast<int>(status) - 1));
  }
}

const char* palpate_last_error() { return c::lastError.text; }
std::uint32_t palpate_last_error_geometry() { return c::lastError.geometry; }
std::size_t palpate_last_error_element() { return c::lastError.element; }
