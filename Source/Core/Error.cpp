#include <palpate/Error.h>

namespace palpate {

Error::Error(ErrorCode code, const std::string& sentence, std::optional<GeometryId> geometry,
             std::optional<std::size_t> element)
    : std::runtime_error(sentence), m_code(code), m_geometry(geometry), m_element(element) {}

}  // namespace palpate
