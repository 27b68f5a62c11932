// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/evaluation/retrieval_evaluation.h"

#include <algorithm>
#include <cerrno>
#include <set>
#include <system_error>

#include <fcntl.h>
#include <stdlib.h>
#include <sys/file.h>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "descriptor/base/stopwatch.h"
#include "index/files/durable_file.h"
#include "index/files/text.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr int kPaperWords = 10;
constexpr int kPaperSample = 10'000;
constexpr std::size_t kKeyDigits = 12;

[[noreturn]] void ThrowInvalid(const std::string& field, const std::string& message) {
  throw Error(ErrorCode::kInvalidArgument, field + "_invalid", field + " " + message);
}

void Validate(const RetrievalOptions& options) {
  if (options.descriptors.empty() && options.features.empty()) {
    ThrowInvalid("descriptors", "must have one or more names");
  }
  if (options.protocols.empty()) ThrowInvalid("protocols", "must have one or more names");
  if (options.words.empty()) ThrowInvalid("words", "must have one or more sizes");
  if (options.seeds < 1) ThrowInvalid("seeds", "must be 1 or more");
  if (options.sample < 0) ThrowInvalid("sample", "must not be negative");
  if (options.jobs < 0) ThrowInvalid("jobs", "must not be negative");
  for (const int words : options.words) {
    if (words < 0) ThrowInvalid("words", "must not be negative");
  }
}

// The folder of the databases: one that stays, locked because two evaluations would overwrite each
// other's galleries; or a temporary one, removed with this object.
class DatabaseFolder {
 public:
  explicit DatabaseFolder(const fs::path& cache) : path_(cache), stays_(!cache.empty()) {
    std::error_code error;
    if (stays_) {
      fs::create_directories(path_, error);
      if (error) Fail(error.message());
      Lock();
      return;
    }
    std::string name = (fs::temp_directory_path() / "pliant-eval-XXXXXX").string();
    const bool made = ::mkdtemp(name.data()) != nullptr;
    path_ = name;
    if (!made) Fail(std::generic_category().message(errno));
  }
  ~DatabaseFolder() {
    std::error_code ignored;  // the system cleans its temporary folder
    if (!stays_) fs::remove_all(path_, ignored);
  }
  DatabaseFolder(const DatabaseFolder&) = delete;
  DatabaseFolder& operator=(const DatabaseFolder&) = delete;

  bool stays() const { return stays_; }

  // One file for each way to describe images.
  fs::path Database(const DescriptorInfo& info, const ExtractionOptions& extraction,
                    bool enlarge) const {
    const std::string what = info.model_id + '/' + std::to_string(extraction.decode.max_side_px) +
                             '/' + std::to_string(extraction.keypoints.max_keypoints) + '/' +
                             std::to_string(extraction.keypoints.keep_repeated_orientations) +
                             (enlarge ? "/enlarged, faint" : "") + "/colours, preview";
    return path_ / (info.name + '-' + Sha256Hex(what).substr(0, kKeyDigits) + ".db");
  }

 private:
  void Lock() {
    folder_ = FileHandle(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!folder_.is_open()) Fail(std::generic_category().message(errno));
    if (::flock(folder_.get(), LOCK_EX | LOCK_NB) == 0) return;
    if (errno != EWOULDBLOCK) Fail(std::generic_category().message(errno));
    throw Error(ErrorCode::kConflict, "cache_in_use",
                "another evaluation is running in " + ToDisplayText(path_.string()) +
                    "; wait until it ends, or give another folder");
  }

  [[noreturn]] void Fail(const std::string& why) const {
    throw Error(ErrorCode::kNoSpace, "folder_unwritable",
                "cannot make the folder " + ToDisplayText(path_.string()) + ": " + why);
  }

  fs::path path_;
  bool stays_;
  FileHandle folder_;
};

SearchOptions ToSearchOptions(RetrievalProtocol protocol, const RetrievalOptions& options) {
  SearchOptions search;
  search.rank = options.rank;
  search.verify_depth = options.verify_depth;
  if (protocol == RetrievalProtocol::kPaper) {
    search.rank = RankMethod::kHistogram;
    search.verify = Verification::kNone;
  } else if (protocol == RetrievalProtocol::kUnverified) {
    search.verify = Verification::kNone;
  }
  return search;
}

// One descriptor and one way to describe images, with all vocabularies.
class Run {
 public:
  Run(RetrievalGallery& gallery, std::string descriptor, const RetrievalOptions& options)
      : gallery_(gallery), descriptor_(std::move(descriptor)), options_(options) {
    Tell("timing " + descriptor_, 0, 0);
    gallery_.TimeExtraction(&extraction_);
  }

  // Protocols that share their vocabularies.
  void Measure(int words, int sample, const std::vector<RetrievalProtocol>& protocols,
               std::vector<RetrievalResult>* results) {
    std::vector<RetrievalResult> rows(protocols.size());
    std::vector<std::vector<RetrievalMetrics>> runs(protocols.size());
    for (int seed = 1; seed <= options_.seeds; ++seed) {
      Tell("training vocabularies for " + descriptor_, seed, options_.seeds);
      const std::size_t size =
          gallery_.UseNewVocabulary(words, sample, static_cast<std::uint64_t>(seed));
      for (std::size_t p = 0; p < protocols.size(); ++p) {
        Tell("searching with " + descriptor_ + ", " + WordOf(protocols[p], kRetrievalProtocols) +
                 ", seed",
             seed, options_.seeds);
        const SearchOptions search = ToSearchOptions(protocols[p], options_);
        RetrievalTimes* const times = seed == 1 ? &rows[p].times : nullptr;
        const bool keeps = options_.keep_answers && seed == 1;
        runs[p].push_back(
            MeasureAll(gallery_.Ask(search, times, keeps ? &rows[p].answers : nullptr)));
        if (seed == 1) Describe(protocols[p], size, search, runs[p].front(), &rows[p]);
      }
    }
    for (std::size_t p = 0; p < protocols.size(); ++p) {
      rows[p].mean = Mean(runs[p]);
      rows[p].spread = Spread(runs[p]);
      if (gallery_.set().layout == RetrievalLayout::kUkbench) rows[p].ns_score = rows[p].mean.ns;
      results->push_back(std::move(rows[p]));
    }
  }

 private:
  static RetrievalMetrics MeasureAll(const std::vector<RetrievalAnswer>& answers) {
    std::vector<RetrievalMetrics> all;
    for (const RetrievalAnswer& answer : answers) all.push_back(MeasureAnswer(answer));
    return Mean(all);
  }

  // What is the same for every seed, or measured with the first only.
  void Describe(RetrievalProtocol protocol, std::size_t words, const SearchOptions& search,
                const RetrievalMetrics& by_image, RetrievalResult* row) {
    row->descriptor = descriptor_;
    row->protocol = WordOf(protocol, kRetrievalProtocols);
    row->words = words;
    row->times.decode = extraction_.decode;
    row->times.detect = extraction_.detect;
    row->times.describe = extraction_.describe;
    row->refused = gallery_.refused_queries();
    row->absent = gallery_.AskAbsent(search);
    row->left_out = gallery_.AskLeftOut(search, options_.keep_answers ? &row->answers : nullptr);
    if (std::ranges::none_of(gallery_.set().images, [](const RetrievalImage& image) {
          return image.is_query && image.is_searched;
        })) {
      row->object = gallery_.several_images_of_an_object()
                        ? gallery_.AskForObjects(search)
                        : ObjectAnswer{by_image.top1, by_image.mrr};
    }
    row->stored_bytes_per_image = gallery_.StoredBytesPerImage();
    row->index_bytes_per_image = gallery_.IndexBytesPerImage();
  }

  void Tell(const std::string& what, int done, int total) const {
    if (options_.progress) {
      options_.progress(what, static_cast<std::size_t>(done), static_cast<std::size_t>(total));
    }
  }

  RetrievalGallery& gallery_;
  std::string descriptor_;
  const RetrievalOptions& options_;
  RetrievalTimes extraction_;
};

void DescribeSet(const RetrievalSet& set, RetrievalReport* report) {
  report->layout = set.layout;
  report->images = report->distractors = report->queries = report->absent = 0;
  std::set<std::string> objects;
  for (const RetrievalImage& image : set.images) {
    report->images += image.is_searched ? 1 : 0;
    report->queries += image.is_query ? 1 : 0;
    report->distractors += image.is_searched && image.object.empty() ? 1 : 0;
    report->absent += image.is_absent ? 1 : 0;
    if (!image.object.empty()) objects.insert(image.object);
  }
  report->objects = objects.size();
  for (const SkippedFile& file : set.skipped) {  // most descriptors skip the same files
    if (std::ranges::find(report->skipped, file.file, &SkippedFile::file) ==
        report->skipped.end()) {
      report->skipped.push_back(file);
    }
  }
}

// A descriptor, or the form of features from elsewhere.
struct Row {
  std::string label;
  std::shared_ptr<const Descriptor> descriptor;
  std::function<Features(const fs::path& image)> features = {};
};

std::vector<Row> MakeRows(const RetrievalSet& set, const RetrievalOptions& options) {
  std::vector<Row> rows;
  for (const std::string& name : options.descriptors) {
    rows.push_back({name, MakeDescriptor(name, options.descriptor_options)});
  }
  for (const FeatureSource& source : options.features) {
    DescriptorInfo info = ForeignDescriptorInfo(source.read(set.images.front().path));
    info.name = "features-" + std::to_string(rows.size());  // the label may be no file's name
    rows.push_back({source.label, MakeForeignDescriptor(std::move(info)), source.read});
  }
  return rows;
}

}  // namespace

RetrievalReport EvaluateRetrieval(const RetrievalSet& set, const RetrievalOptions& options) {
  Validate(options);
  const Stopwatch watch;
  const std::vector<Row> rows = MakeRows(set, options);  // all, before the long work begins
  const DatabaseFolder folder(options.cache);
  const DatabaseFolder temporary("");  // features from elsewhere may be others the next time
  RetrievalReport report;
  report.seeds = options.seeds;
  std::vector<RetrievalProtocol> product = options.protocols;
  const bool paper = std::erase(product, RetrievalProtocol::kPaper) > 0;
  // Runs work(run) on the set, described as the product does (enlarge) or as the paper does.
  const auto with_gallery = [&](const Row& row, bool enlarge, const auto& work) {
    const DatabaseFolder& databases = row.features ? temporary : folder;
    RetrievalGalleryOptions gallery_options;
    gallery_options.descriptor = row.descriptor;
    gallery_options.features = row.features;
    gallery_options.extraction = options.extraction;
    gallery_options.enlarge = enlarge;
    gallery_options.database =
        databases.Database(row.descriptor->info(), options.extraction, enlarge);
    gallery_options.keep_features = databases.stays();
    gallery_options.jobs = options.jobs;
    gallery_options.stop = options.stop;
    gallery_options.progress = [&](std::size_t done, std::size_t total) {
      if (options.progress) options.progress("describing with " + row.label, done, total);
    };
    RetrievalGallery gallery(set, gallery_options);
    Run run(gallery, row.label, options);
    work(run);
    DescribeSet(gallery.set(), &report);
  };
  for (const Row& row : rows) {
    if (paper) {
      with_gallery(row, false, [&](Run& run) {
        run.Measure(kPaperWords, kPaperSample, {RetrievalProtocol::kPaper}, &report.results);
      });
    }
    if (product.empty()) continue;
    with_gallery(row, true, [&](Run& run) {
      for (const int words : options.words) {
        run.Measure(words, options.sample, product, &report.results);
      }
    });
  }
  report.seconds = watch.seconds();
  return report;
}

}  // namespace pliant
