// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a scene says of its views as JSON; see FORMAT in this folder's README.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "descriptor/simulation/scene.h"

namespace pliant::simulation {

// Camera, lights, photo, framing, motion of one view as a JSON object.
nlohmann::ordered_json ViewJson(const View& view);

// On one line, or indented by two. What is no UTF-8 (a texture's file name) becomes U+FFFD.
std::string JsonText(const nlohmann::ordered_json& json, bool indented = false);

}  // namespace pliant::simulation
