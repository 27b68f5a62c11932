// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Data sets for retrieval: which image shows which object, which images are queries, and which
// are searched.
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "index/files/image_files.h"

namespace pliant {

enum class RetrievalLayout {
  kAuto,  // detected from the names in the folder
  // DIR/<object>/*: files whose name starts with "ref" are the queries, the rest is searched;
  // without such files every image is searched for among all others.
  kObjects,
  // DIR/ukbenchNNNNN.*: object = NNNNN / 4; every image is searched for among all, itself
  // included (Nister and Stewenius, "Scalable Recognition with a Vocabulary Tree", CVPR 2006).
  kUkbench,
  kPairs,   // DIR/query/<id>.* and DIR/gallery/<id>.*
  kLabels,  // DIR/query/* and DIR/ref/* (searched): object = leading letters and digits of the name
};
inline const std::vector<std::pair<std::string, RetrievalLayout>> kRetrievalLayouts = {
    {"auto", RetrievalLayout::kAuto},
    {"objects", RetrievalLayout::kObjects},
    {"ukbench", RetrievalLayout::kUkbench},
    {"pairs", RetrievalLayout::kPairs},
    {"labels", RetrievalLayout::kLabels}};

// The word of an enumerator in such a list.
template <typename Enum>
const std::string& WordOf(Enum value, const std::vector<std::pair<std::string, Enum>>& choices) {
  return std::ranges::find(choices, value, &std::pair<std::string, Enum>::second)->first;
}

struct RetrievalImage {
  std::filesystem::path path;
  std::string object;  // empty: a distractor, which is never a right answer
  bool is_query = false;
  bool is_searched = false;  // belongs to the gallery
  // A further query that shows none of the objects: each hit is a false alarm.
  bool is_absent = false;
};

struct RetrievalSet {
  RetrievalLayout layout = RetrievalLayout::kObjects;
  std::vector<RetrievalImage> images;  // by name, distractors last
  // Whether a query that is searched itself counts as a correct answer; otherwise it is removed
  // from its own results.
  bool counts_itself = false;
  std::vector<SkippedFile> skipped;  // files that do not fit the layout, with the reason
};

// Reads the names only, not the images. `distractors` and `absent`: folders of images that show
// none of the objects, to be searched or asked. Throws kNotFound for a missing folder,
// kUnprocessable "layout_unknown", "no_distractors" or "no_absent" for a folder without images, and
// "nothing_to_search", "one_object" or "no_queries" when the rest cannot be measured.
RetrievalSet ReadRetrievalSet(const std::filesystem::path& folder, RetrievalLayout layout,
                              const std::vector<std::filesystem::path>& distractors = {},
                              const std::vector<std::filesystem::path>& absent = {});

// For each image of the set, how many other images (itself too when counts_itself) are right
// answers to it.
std::vector<std::size_t> CountRightAnswers(const RetrievalSet& set);

}  // namespace pliant
