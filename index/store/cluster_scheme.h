// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Databases that are clusters: "clickhouse://host:8123/pliant?keeper=...". What opens them is a
// library of its own (index/store/clickhouse), which a program may have or not.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "index/store/open_store.h"

namespace pliant {

// Whether a database's name says that it is a cluster, and not a file.
bool IsClusterUrl(std::string_view database);

// Where a server puts what it needs for a moment: beside the database's file, and for a cluster
// where this system keeps temporary files.
std::filesystem::path FolderOf(const std::filesystem::path& database);

struct ClusterOpener {
  std::unique_ptr<Store> (*store)(const StoreOptions& options) = nullptr;
  std::unique_ptr<ServiceStore> (*service_store)(const std::string& url) = nullptr;
};

// Lets OpenStore and OpenServiceStore open clusters, where the build has them (the library
// pliant_clusters): the first thing that a program calls.
void UseClusters();

// For UseClusters.
void SetClusterOpener(const ClusterOpener& opener);
// Throws kInvalidArgument "cluster_unsupported" in a program without it.
const ClusterOpener& RequireClusterOpener();

}  // namespace pliant
