// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace pliant::server {

// What Accept or Accept-Encoding lists, in lower case, and its q-value in thousandths (RFC 9110,
// section 12.4.2). Of a name that is listed twice the first counts. Entries with a broken q-value
// or other parameters are left out.
std::map<std::string, int> WeightsOf(std::string_view list);

}  // namespace pliant::server
