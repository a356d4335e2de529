// What the server tells, as JSON and for people.
#pragma once

#include <ostream>

#include "client/cli/console.h"
#include "client/cpp/info.h"

namespace deform::cli {

Json ToJson(const ModelInfo& model);
Json ToJson(const BindQuality& quality);
Json ToJson(const BindingInfo& binding);
Json ToJson(const SessionInfo& session);
Json ToJson(const SchemeInfo& scheme);

// One line for each property.
void Describe(const ModelInfo& model, std::ostream& out);
void Describe(const BindingInfo& binding, std::ostream& out);
void Describe(const SessionInfo& session, std::ostream& out);

// "2026-01-31T12:00:00Z", in UTC.
std::string TimeText(WallTime time);
// "resident"
std::string WeightStateText(WeightState state);
std::string WeightFormText(WeightForm form);

}  // namespace deform::cli
