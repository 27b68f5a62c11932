// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the answers look like (JSON Schema 2020-12). A test holds every answer of the examples
// against these.
#include "server/openapi/document.h"

namespace pliant::server {

namespace {

constexpr const char* kCatalogue = R"json({
  "Status": {"type": "object", "required": ["status"],
    "properties": {"status": {"type": "string"}}},
  "Collection": {"type": "object",
    "required": ["name", "images", "objects", "descriptors", "vocabulary", "created_at"],
    "properties": {
      "name": {"type": "string"},
      "images": {"type": "integer"}, "objects": {"type": "integer"},
      "descriptors": {"type": "integer", "description": "key points of all pictures"},
      "vocabulary": {"oneOf": [{"$ref": "#/components/schemas/Vocabulary"}, {"type": "null"}],
        "description": "the active one"},
      "created_at": {"type": "string", "format": "date-time"}}},
  "CollectionList": {"type": "object", "required": ["collections"],
    "properties": {"collections": {"type": "array", "items": {"type": "string"}}}},
  "Image": {"type": "object",
    "required": ["id", "collection", "object", "metadata", "source", "sha256", "media_type",
      "bytes", "width", "height", "keypoints", "added_at"],
    "properties": {
      "id": {"type": "string"}, "collection": {"type": "string"},
      "object": {"type": "string", "description": "what it shows; may be empty"},
      "metadata": {"type": "object", "additionalProperties": true},
      "source": {"type": "string", "description": "file name as given; may be empty"},
      "sha256": {"type": "string", "description": "of the uploaded bytes"},
      "media_type": {"type": "string"},
      "bytes": {"type": "integer", "description": "of the upload"},
      "width": {"type": "integer"}, "height": {"type": "integer"},
      "keypoints": {"type": "integer"},
      "added_at": {"type": "string", "format": "date-time"}}},
  "ImageList": {"type": "object", "required": ["images", "next"],
    "properties": {
      "images": {"type": "array", "items": {"$ref": "#/components/schemas/Image"}},
      "next": {"type": ["string", "null"], "description": "cursor of the next page"}}},
  "Object": {"type": "object", "required": ["object", "images", "image_id"],
    "properties": {"object": {"type": "string"}, "images": {"type": "integer"},
      "image_id": {"type": ["string", "null"], "description": "one of its pictures"}}},
  "Demo": {"type": "object", "required": ["loaded", "objects"],
    "properties": {"loaded": {"type": "boolean"},
      "objects": {"type": "array", "items": {"type": "object",
        "required": ["object", "image_id", "crumpled"],
        "properties": {"object": {"type": "string"}, "image_id": {"type": "string"},
          "crumpled": {"type": "string", "description": "address of its crumpled picture"}}}}}},
  "ObjectList": {"type": "object", "required": ["objects", "next"],
    "properties": {
      "objects": {"type": "array", "items": {"$ref": "#/components/schemas/Object"}},
      "next": {"type": ["string", "null"], "description": "cursor of the next page"}}},
  "Location": {"type": "object", "additionalProperties": true,
    "required": ["object", "image_id", "took_ms", "width", "height", "compared"],
    "properties": {"object": {"type": "string"},
      "image_id": {"type": ["string", "null"], "description": "the picture that was compared"},
      "took_ms": {"type": "number"},
      "width": {"type": "integer"}, "height": {"type": "integer"},
      "compared": {"type": "integer", "description": "pictures that were compared"}}},
  "ObjectDeleted": {"type": "object", "required": ["object", "deleted"],
    "properties": {"object": {"type": "string"}, "deleted": {"type": "integer"}}},
  "Features": {"type": "object",
    "required": ["width", "height", "model_id", "keypoints", "descriptors"],
    "properties": {
      "width": {"type": "integer"}, "height": {"type": "integer"},
      "model_id": {"type": "string"},
      "keypoints": {"type": "array", "items": {"type": "object",
        "required": ["x", "y", "size", "angle", "response"],
        "properties": {
          "x": {"type": "number", "description": "pixels of the upright picture"},
          "y": {"type": "number"}, "size": {"type": "number"},
          "angle": {"type": "number", "description": "degrees, clockwise"},
          "response": {"type": "number"}}}},
      "descriptors": {"type": "object", "required": ["type", "rows", "dim", "base64"],
        "properties": {
          "type": {"enum": ["float32", "uint8"]},
          "rows": {"type": "integer"}, "dim": {"type": "integer"},
          "base64": {"type": "string", "description": "little-endian, row by row"}}}}}
})json";

constexpr const char* kSearch = R"json({
  "ImagePatch": {"type": "object", "additionalProperties": false,
    "description": "a JSON merge patch (RFC 7396): what is left out stays as it is",
    "properties": {
      "object": {"type": ["string", "null"], "description": "what the picture shows; null or empty: nothing in particular"},
      "metadata": {"type": ["object", "null"], "additionalProperties": true,
        "description": "keys to set; null removes a key, or in place of the object all of them"},
      "source": {"type": ["string", "null"], "description": "its file's name, for people"}}},
  "ObjectPatch": {"type": "object", "additionalProperties": false, "required": ["object"],
    "properties": {"object": {"type": "string", "minLength": 1, "description": "its new name"}}},
  "SearchAnswer": {"type": "object",
    "required": ["took_ms", "rank", "vocabulary", "words", "keypoints", "query", "total", "found", "hits", "timings"],
    "properties": {
      "took_ms": {"type": "number"},
      "rank": {"type": "string", "enum": ["neighbours", "tfidf", "histogram"],
        "description": "the ranking that was used: tfidf in place of neighbours where the vocabulary is of an earlier version"},
      "vocabulary": {"type": "integer", "description": "number of the one that answered"},
      "words": {"type": "integer", "description": "its size"},
      "keypoints": {"type": "integer", "description": "of the query, inside the region"},
      "query": {"$ref": "#/components/schemas/Size"},
      "total": {"type": "integer", "description": "hits there are, over all pages"},
      "found": {"type": ["integer", "null"], "description": "hits with a probability of 0.9 or more; 0: what the picture shows is not in the collection; null where hits have no probability"},
      "hits": {"type": "array", "items": {"$ref": "#/components/schemas/Hit"}},
      "timings": {"type": "object", "additionalProperties": {"type": "number"}}}},
  "Hit": {"type": "object",
    "required": ["rank", "object", "score", "probability", "image_id", "source", "inliers", "polygon", "metadata"],
    "properties": {
      "rank": {"type": "integer", "description": "from 1, over all pages"},
      "object": {"type": ["string", "null"], "description": "null: the picture has none"},
      "score": {"type": "number", "minimum": 0, "maximum": 1},
      "probability": {"type": ["number", "null"], "minimum": 0, "maximum": 1,
        "description": "that the hit is right; null without verification and for other rankings than neighbours"},
      "image_id": {"type": "string", "description": "the object's best picture"},
      "source": {"type": "string", "description": "its file's name as given; may be empty"},
      "inliers": {"type": "integer", "description": "matches that agree on one smooth warp"},
      "polygon": {"type": ["array", "null"],
        "description": "outline of the object in the query picture",
        "items": {"type": "array", "items": {"type": "number"}}},
      "instances": {"type": "array", "description": "each place where it is in the query",
        "items": {"type": "object", "required": ["inliers", "polygon"],
          "properties": {"inliers": {"type": "integer"},
            "polygon": {"type": ["array", "null"],
              "items": {"type": "array", "items": {"type": "number"}}}}}},
      "via": {"type": ["string", "null"],
        "description": "the hit that this one agrees with, where that raised it (expand)"},
      "metadata": {"type": "object", "additionalProperties": true},
      "explain": {"$ref": "#/components/schemas/Explanation"}}},
  "Size": {"type": "object", "required": ["width", "height"],
    "description": "of the upright picture, in pixels",
    "properties": {"width": {"type": "integer"}, "height": {"type": "integer"}}},
  "Explanation": {"type": "object",
    "required": ["ranking_score", "verified", "failure", "matches", "inlier_fraction", "pairs",
      "reference", "mesh"],
    "properties": {
      "ranking_score": {"type": "number", "description": "the score by words alone"},
      "verified": {"type": "boolean"},
      "failure": {"type": ["string", "null"], "description": "why it was refused"},
      "matches": {"type": "integer"}, "inlier_fraction": {"type": "number"},
      "pairs": {"type": "array", "description": "query x, query y, hit x, hit y",
        "items": {"type": "array", "items": {"type": "number"}}},
      "reference": {"oneOf": [{"$ref": "#/components/schemas/Size"}, {"type": "null"}]},
      "mesh": {"type": ["object", "null"], "additionalProperties": true,
        "description": "the warp: where a grid over the hit's picture lies in the query"}}},
  "Vocabulary": {"type": "object",
    "required": ["id", "words", "active", "model_id", "method", "seed", "sampled", "available",
      "loss", "created_at"],
    "properties": {
      "id": {"type": "integer"}, "words": {"type": "integer"}, "active": {"type": "boolean"},
      "model_id": {"type": "string"}, "method": {"type": "string"},
      "seed": {"type": "integer"},
      "sampled": {"type": "integer", "description": "descriptors it was chosen from"},
      "available": {"type": "integer", "description": "descriptors there were"},
      "loss": {"type": "number"},
      "created_at": {"type": "string", "format": "date-time"}}},
  "VocabularyList": {"type": "object", "required": ["vocabularies"],
    "properties": {"vocabularies": {"type": "array",
      "items": {"$ref": "#/components/schemas/Vocabulary"}}}}
})json";

constexpr const char* kService = R"json({
  "Problem": {"type": "object",
    "required": ["type", "title", "status", "code", "detail", "request_id"],
    "properties": {
      "type": {"type": "string", "format": "uri"}, "title": {"type": "string"},
      "status": {"type": "integer"},
      "code": {"type": "string", "description": "stable, for programs"},
      "detail": {"type": "string", "description": "for people"},
      "request_id": {"type": "string"},
      "parameter": {"type": "string", "description": "the parameter at fault"},
      "image_id": {"type": "string", "description": "with `same_bytes`: the picture that has them"},
      "object": {"type": "string", "description": "with `same_bytes`: what that picture shows"},
      "progress": {"type": "number", "description": "with `starting`: which share is loaded"}}},
  "BatchAnswer": {"type": "object",
    "required": ["created", "replaced", "unchanged", "failed", "results"],
    "properties": {
      "created": {"type": "integer"}, "replaced": {"type": "integer"},
      "unchanged": {"type": "integer"}, "failed": {"type": "integer"},
      "results": {"type": "array", "items": {"type": "object",
        "required": ["index", "source", "status"],
        "properties": {
          "index": {"type": "integer"},
          "source": {"type": "string", "description": "file name as given"},
          "status": {"type": "integer", "description": "as a request of its own would have"},
          "outcome": {"enum": ["created", "replaced", "unchanged"]},
          "image": {"$ref": "#/components/schemas/Image"},
          "problem": {"$ref": "#/components/schemas/ProblemSummary"}}}}}},
  "ProblemSummary": {"type": "object", "required": ["code", "detail"],
    "properties": {"code": {"type": "string"}, "detail": {"type": "string"},
      "parameter": {"type": "string"}}},
  "Backup": {"type": "object", "required": ["name", "bytes", "created_at"],
    "properties": {"name": {"type": "string"}, "bytes": {"type": "integer"},
      "created_at": {"type": "string", "format": "date-time"}}},
  "BackupList": {"type": "object", "required": ["backups"],
    "properties": {"backups": {"type": "array", "items": {"$ref": "#/components/schemas/Backup"}}}},
  "Job": {"type": "object",
    "required": ["id", "kind", "collection", "parameters", "state", "done", "total", "failed",
      "attempts", "created_at", "finished_at"],
    "properties": {
      "id": {"type": "string"}, "kind": {"type": "string"}, "collection": {"type": "string"},
      "state": {"enum": ["queued", "running", "done", "failed", "cancelled"]},
      "done": {"type": "number", "description": "of `total`"}, "total": {"type": "number"},
      "failed": {"type": "integer", "description": "items that could not be done"},
      "created_at": {"type": "string", "format": "date-time"},
      "finished_at": {"type": ["string", "null"], "format": "date-time"},
      "attempts": {"type": "integer", "description": "times it was begun"},
      "parameters": {"type": "object", "additionalProperties": true},
      "skipped": {"type": "array", "description": "items left out, the first hundred",
        "items": {"type": "object", "required": ["item", "code", "reason"],
          "properties": {"item": {"type": "string"}, "code": {"type": "string"},
            "reason": {"type": "string"}}}},
      "result": {"type": "string", "description": "address of what was made"},
      "problem": {"$ref": "#/components/schemas/ProblemSummary"}}},
  "JobList": {"type": "object", "required": ["jobs"],
    "properties": {"jobs": {"type": "array", "items": {"$ref": "#/components/schemas/Job"}}}}
})json";

}  // namespace

Json OpenApiSchemas() {
  Json schemas = Json::object();
  for (const char* part : {kCatalogue, kSearch, kService}) schemas.update(Json::parse(part));
  return schemas;
}

}  // namespace pliant::server
