// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/retrieval_set.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <set>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kUkbenchName = "ukbench";
constexpr std::size_t kUkbenchDigits = 5;
constexpr unsigned long kUkbenchViews = 4;

[[noreturn]] void ThrowUnprocessable(const std::string& reason, const std::string& message) {
  throw Error(ErrorCode::kUnprocessable, reason, message);
}

// The number in ukbenchNNNNN.jpg.
std::optional<unsigned long> UkbenchNumber(const fs::path& file) {
  const std::string stem = file.stem().string();
  if (stem.size() != kUkbenchName.size() + kUkbenchDigits || !stem.starts_with(kUkbenchName))
    return std::nullopt;
  const std::string digits = stem.substr(kUkbenchName.size());
  if (!std::all_of(digits.begin(), digits.end(), [](unsigned char c) { return std::isdigit(c); }))
    return std::nullopt;
  return std::stoul(digits);
}

// "mug12" of "mug12_front.jpg" and of "mug12-3.jpg".
std::string Label(const fs::path& file) {
  const std::string stem = file.stem().string();
  const auto end =
      std::find_if(stem.begin(), stem.end(), [](unsigned char c) {  // beyond ASCII all are letters
        return c < 0x80 && std::isalnum(c) == 0;
      });
  return ToDisplayText(end == stem.begin() ? stem : std::string(stem.begin(), end));
}

bool IsReference(const fs::path& file) {
  return Lower(file.filename().string().substr(0, 3)) == "ref";
}

class Reader {
 public:
  Reader(fs::path folder, RetrievalSet* set) : folder_(std::move(folder)), set_(*set) {
    std::error_code error;
    if (!fs::is_directory(folder_, error)) {
      throw Error(ErrorCode::kNotFound, "folder_not_found",
                  DisplayPath() + " is not a readable directory");
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with('.')) continue;
      if (entry.is_directory()) {
        if (IsSystemFolder(name)) continue;
        folders_.push_back(entry.path());
      } else if (LooksLikeImage(entry.path())) {
        files_.push_back(entry.path());
      }
    }
    std::sort(folders_.begin(), folders_.end());
    std::sort(files_.begin(), files_.end());
  }

  RetrievalLayout Guess() const {
    if (Has("query") && Has("gallery")) return RetrievalLayout::kPairs;
    if (Has("query") && Has("ref")) return RetrievalLayout::kLabels;
    if (std::any_of(files_.begin(), files_.end(),
                    [](const fs::path& file) { return UkbenchNumber(file).has_value(); }))
      return RetrievalLayout::kUkbench;
    if (!folders_.empty()) return RetrievalLayout::kObjects;
    ThrowUnprocessable(
        "layout_unknown",
        DisplayPath() + (files_.empty() ? " holds no images" : " has images but no folders") +
            "; expected one folder per object, ukbenchNNNNN.jpg files, query/ and gallery/, or "
            "query/ and ref/ (layout objects, ukbench, pairs, labels)");
  }

  void ReadObjects() {
    for (const fs::path& file : files_) Skip(file, "it is not in the folder of an object");
    bool has_references = false;
    for (const fs::path& folder : folders_) {
      const std::string object = ToDisplayText(folder.filename().string());
      for (const fs::path& file : ImagesBelow(folder)) {
        const bool reference = IsReference(file);
        has_references = has_references || reference;
        set_.images.push_back({file, object, reference, !reference});
      }
    }
    if (has_references) return;
    for (RetrievalImage& image : set_.images) image.is_query = true;
  }

  void ReadUkbench() {
    set_.counts_itself = true;
    for (const fs::path& file : files_) {
      const auto number = UkbenchNumber(file);
      if (!number) {
        Skip(file, "its name is not of the form ukbenchNNNNN.jpg");
        continue;
      }
      set_.images.push_back({file, std::to_string(*number / kUkbenchViews), true, true});
    }
  }

  template <typename Name>
  void ReadFolders(const char* queries, const char* searched, const Name& name) {
    for (const char* folder : {queries, searched}) {
      if (!Has(folder)) {
        ThrowUnprocessable("layout_unknown", DisplayPath() + " has no folder " + folder +
                                                 "/, which this layout needs");
      }
    }
    for (const fs::path& file : ImagesBelow(folder_ / queries)) {
      set_.images.push_back({file, name(file), true, false});
    }
    for (const fs::path& file : ImagesBelow(folder_ / searched)) {
      set_.images.push_back({file, name(file), false, true});
    }
  }

  std::vector<fs::path> ImagesBelow(const fs::path& folder) {
    ImageFiles found = FindImages({folder}, ObjectFrom::kNone);
    set_.skipped.insert(set_.skipped.end(), found.skipped.begin(), found.skipped.end());
    std::vector<fs::path> files;
    for (ImageFile& image : found.images) files.push_back(std::move(image.path));
    return files;
  }

 private:
  bool Has(const char* name) const {
    return std::find(folders_.begin(), folders_.end(), folder_ / name) != folders_.end();
  }
  std::string DisplayPath() const { return ToDisplayText(folder_.string()); }
  void Skip(const fs::path& file, const std::string& reason) {
    set_.skipped.push_back({ToDisplayText(file.string()), "no_place_in_layout", reason});
  }

  fs::path folder_;
  RetrievalSet& set_;
  std::vector<fs::path> folders_;
  std::vector<fs::path> files_;
};

// Removes queries that have no correct answer; images that were only queries are listed in
// `skipped`. Throws when the rest cannot be measured.
void CheckRetrievalSet(RetrievalSet* set) {
  const std::vector<std::size_t> right = CountRightAnswers(*set);
  std::vector<RetrievalImage> kept;
  std::set<std::string> objects;
  std::size_t queries = 0;
  std::size_t searched = 0;
  bool has_distractors = false;
  for (std::size_t i = 0; i < set->images.size(); ++i) {
    RetrievalImage& image = set->images[i];
    if (image.is_query && right[i] == 0) {
      image.is_query = false;
      if (!image.is_searched) {
        set->skipped.push_back({ToDisplayText(image.path.string()), "no_right_answer",
                                "no searched image shows the object " + image.object});
        continue;
      }
    }
    queries += image.is_query ? 1 : 0;
    searched += image.is_searched ? 1 : 0;
    if (!image.object.empty()) {
      objects.insert(image.object);
    } else if (image.is_searched) {
      has_distractors = true;
    }
    kept.push_back(std::move(image));
  }
  set->images = std::move(kept);
  const std::string layout = " (layout " + WordOf(set->layout, kRetrievalLayouts) + ")";
  if (searched == 0) ThrowUnprocessable("nothing_to_search", "no image to search" + layout);
  if (objects.size() == 1 && !has_distractors) {
    ThrowUnprocessable("one_object", "all images show one object, " + *objects.begin() +
                                         ", so every answer would be right" + layout);
  }
  if (queries == 0) {
    ThrowUnprocessable("no_queries",
                       "no query has a correct answer among the searched images" + layout);
  }
}

}  // namespace

RetrievalSet ReadRetrievalSet(const fs::path& folder, RetrievalLayout layout,
                              const std::vector<fs::path>& distractors,
                              const std::vector<fs::path>& absent) {
  RetrievalSet set;
  Reader reader(folder, &set);
  set.layout = layout == RetrievalLayout::kAuto ? reader.Guess() : layout;
  switch (set.layout) {
    case RetrievalLayout::kUkbench:
      reader.ReadUkbench();
      break;
    case RetrievalLayout::kPairs:
      reader.ReadFolders("query", "gallery",
                         [](const fs::path& file) { return ToDisplayText(file.stem().string()); });
      break;
    case RetrievalLayout::kLabels:
      reader.ReadFolders("query", "ref", Label);
      break;
    default:
      reader.ReadObjects();
  }
  const auto add_all = [&](const std::vector<fs::path>& folders, const char* reason,
                           const RetrievalImage& as) {
    for (const fs::path& more : folders) {
      const std::vector<fs::path> files = reader.ImagesBelow(more);
      if (files.empty()) {
        ThrowUnprocessable(reason, ToDisplayText(more.string()) + " holds no images");
      }
      for (const fs::path& file : files) {
        set.images.push_back(as);
        set.images.back().path = file;
      }
    }
  };
  add_all(distractors, "no_distractors", {{}, "", false, true, false});
  add_all(absent, "no_absent", {{}, "", false, false, true});
  CheckRetrievalSet(&set);
  return set;
}

std::vector<std::size_t> CountRightAnswers(const RetrievalSet& set) {
  std::map<std::string, std::size_t> searched;
  for (const RetrievalImage& image : set.images) {
    if (image.is_searched && !image.object.empty()) ++searched[image.object];
  }
  std::vector<std::size_t> right;
  right.reserve(set.images.size());
  for (const RetrievalImage& image : set.images) {
    const auto found = searched.find(image.object);
    const std::size_t all = found == searched.end() ? 0 : found->second;
    right.push_back(all - (image.is_searched && !set.counts_itself && all > 0 ? 1 : 0));
  }
  return right;
}

}  // namespace pliant
