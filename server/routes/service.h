// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The state that all routes share.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "descriptor/base/lru_cache.h"
#include "index/engine/engine.h"
#include "index/store/service_store.h"
#include "server/decoder/decoder_pool.h"
#include "server/fetch/fetcher.h"
#include "server/http/message.h"
#include "server/jobs/backups.h"
#include "server/jobs/bulk_files.h"
#include "server/jobs/demonstration.h"
#include "server/jobs/training.h"
#include "server/jobs/worker_pool.h"
#include "server/peers/peers.h"
#include "server/routes/metrics.h"

namespace pliant::server {

struct ServiceOptions {
  EngineOptions engine;
  std::optional<DecoderOptions> decoder;  // absent: decode images inside this process
  WorkerPoolOptions pool;
  std::filesystem::path peers;       // file with the servers of all parts; empty = none
  bool auto_train = true;            // train vocabularies automatically, see AutoTrainer
  std::filesystem::path import_dir;  // clients can import images below it; empty = off
  std::filesystem::path backup_dir;  // for backups over HTTP; empty = off
  BulkFileOptions bulk;              // imports that are too large for the database
  FetchOptions fetch;                // images that clients name by their URL
};

// Constructed before the index is loaded; engine() only after Open().
class Service {
 public:
  explicit Service(ServiceOptions options);
  ~Service();

  // Starts decoders and loads the index. Throws what DecoderPool's and Engine's constructors throw.
  void Open();

  Engine& engine() { return *engine_; }
  const ImageDecoder& decode() const { return decode_; }
  const DecoderPool* decoders() const { return decoders_.get(); }  // null: decoding inside
  bool ready() const { return ready_; }
  ServiceStore& store() { return *store_; }                    // API keys; not before Open()
  Peers* peers() { return peers_.get(); }                      // null: the index has one part
  double loaded() const { return loaded_; }                    // the share of the index, 0..1
  StoreFigures& figures() { return *figures_; }                // not before Open()
  AutoTrainer* auto_trainer() { return auto_trainer_.get(); }  // null when switched off

  // To be called after images were added to the collection: it may need a vocabulary.
  void OnAdded(const std::string& collection) {
    if (auto_trainer_) auto_trainer_->OnAdded(collection);
  }

  // The image as a JPEG with no longer side, made on the pool. The options of decoding limit the
  // image, but not the file's length, which the upload passed. Throws what the decoder throws.
  std::string Shrink(Bytes encoded, int longer_side_px);

  const ServiceOptions options;
  WorkerPool pool;
  std::atomic<int> parts_ranking{0};                        // of searches of other servers
  LruCache<std::string, std::string> thumbnails{32 << 20};  // JPEG, by the original's SHA-256
  Metrics metrics;
  const Backups backups;
  const BulkFiles bulk_files;
  Fetcher fetcher;
  // Jobs use the engine, so they end first: see ~Service. Null before Open().
  std::unique_ptr<JobStore> jobs;

 private:
  void StartDecoders();

  std::unique_ptr<DecoderPool> decoders_;
  ImageDecoder decode_ = DecodeImage;
  std::unique_ptr<Peers> peers_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<StoreFigures> figures_;  // asks the engine, so it ends before it
  std::unique_ptr<ServiceStore> store_;
  std::unique_ptr<JobRunner> runner_;
  std::unique_ptr<AutoTrainer> auto_trainer_;
  std::atomic<bool> ready_{false};
  std::atomic<double> loaded_{0};
};

// The name of the collection that the {c} of the path names, maybe by an alias. For handlers that
// use the collection several times: aliases can move between two calls of the engine, which takes
// aliases, too. kNotFound "collection_not_found".
std::string CollectionOf(Service& service, const Request& request);

}  // namespace pliant::server
