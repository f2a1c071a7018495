#pragma once

/// What was seen, as the API tells it.

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "core/image/frame.h"
#include "core/recognition/outcome.h"
#include "core/recognition/recognizer.h"

namespace eigenpose {

/// One thing to tell: what stands there, or that something moves. Refers to its parts; they outlive it.
struct Result {
  enum class State { settled, changing };
  State state = State::settled;
  const Frame* frame = nullptr;
  const Model* model = nullptr;       ///< names the DOFs of each object; null while changing
  std::span<const Outcome> outcomes;  ///< empty while changing, and for an empty table
  std::optional<RecognitionTimes> times;
};

/// One line of JSON. daemon/api/README.md describes it.
std::string result_json(const Result& result, std::uint64_t sequence);

/// The same in a few words for the log: "verdict=recognized object=mug table_deg=12.3".
std::string result_words(const Result& result);

}  // namespace eigenpose
