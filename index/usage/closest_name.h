// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The word that somebody meant.
#pragma once

#include <string>
#include <vector>

namespace pliant::cli {

// The one of `names` that differs from `word` by the fewest typing errors (optimal string alignment
// distance: wrong, missing, additional and swapped characters), if these are few for its length;
// else empty.
std::string ClosestName(const std::string& word, const std::vector<std::string>& names);

// "; did you mean --top?", or empty.
std::string DidYouMean(const std::string& word, const std::vector<std::string>& names);

}  // namespace pliant::cli
