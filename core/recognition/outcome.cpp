#include "core/recognition/outcome.h"

namespace eigenpose {

std::string_view verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::recognized:
      return "recognized";
    case Verdict::unknown:
      return "unknown";
    case Verdict::ambiguous:
      return "ambiguous";
    case Verdict::touches_border:
      return "touches_border";
    case Verdict::too_small:
      return "too_small";
  }
  return "unknown";
}

}  // namespace eigenpose
