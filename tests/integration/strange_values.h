// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Values that nobody means: empty, huge, negative, of another type, no numbers, not UTF-8, deep.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace pliant::testing {

std::string Repeated(const std::string& text, std::size_t times);
std::string Encoded(const std::string& text);  // for a path or a query

const std::vector<std::string>& StrangeTexts();    // for the query, paths and form fields
const std::vector<std::string>& StrangeJson();     // values of JSON, as text
const std::vector<std::string>& StrangeBodies();   // whole bodies of JSON
const std::vector<std::string>& StrangeHeaders();  // without control characters

}  // namespace pliant::testing
