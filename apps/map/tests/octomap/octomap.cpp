// What OctoMap itself makes of scans: the baseline of the benchmark, and the judge of the equality test.
//
//   octomap SCANS RESOLUTION MAX_RANGE MODE [LEAVES]
//
// SCANS: a SCN1 file ("SCN1", u32 scans; each: f32 origin[3], u32 points, f32 points[][3]). MODE: `plain`, `discretize`, or
// `best` (discretized and lazy, inner nodes and pruning once at the end). Prints the CPU microseconds of each scan, a line
// each (the end's are the last's), then `heap BYTES` and `leaves CHECKSUM`; with LEAVES it writes every voxel's key and log-odds.
#include <malloc.h>
#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <octomap/octomap.h>

static double cpu_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return t.tv_sec + t.tv_nsec * 1e-9;
}

struct Scan {
  octomap::point3d origin;
  octomap::Pointcloud points;
};

template <class T>
static T read(FILE* file) {
  T value;
  if (fread(&value, sizeof value, 1, file) != 1) exit(2);
  return value;
}

static octomap::point3d read_point(FILE* file) {
  float x = read<float>(file), y = read<float>(file), z = read<float>(file);
  return octomap::point3d(x, y, z);
}

static std::vector<Scan> read_scans(const char* name) {
  FILE* file = fopen(name, "rb");
  if (!file || read<uint32_t>(file) != 0x314e4353) exit(2);
  std::vector<Scan> scans(read<uint32_t>(file));
  for (Scan& scan : scans) {
    scan.origin = read_point(file);
    uint32_t points = read<uint32_t>(file);
    scan.points.reserve(points);
    for (uint32_t i = 0; i < points; ++i) scan.points.push_back(read_point(file));
  }
  fclose(file);
  return scans;
}

struct Leaf {
  uint16_t key[3];
  float log_odds;
};

// Every voxel by itself: a pruned leaf stands for its whole cube.
static std::vector<Leaf> leaves_of(const octomap::OcTree& tree) {
  std::vector<Leaf> leaves;
  for (auto it = tree.begin_leafs(); it != tree.end_leafs(); ++it) {
    int edge = 1 << (tree.getTreeDepth() - it.getDepth());
    octomap::OcTreeKey key = it.getIndexKey();
    for (int i = 0; i < edge * edge * edge; ++i)
      leaves.push_back({{uint16_t(key[0] + i % edge), uint16_t(key[1] + i / edge % edge), uint16_t(key[2] + i / edge / edge)},
                        it->getLogOdds()});
  }
  std::sort(leaves.begin(), leaves.end(), [](const Leaf& a, const Leaf& b) {
    return std::lexicographical_compare(a.key, a.key + 3, b.key, b.key + 3);
  });
  return leaves;
}

// FNV-1a over keys and log-odds, little endian.
static uint64_t checksum(const std::vector<Leaf>& leaves) {
  uint64_t hash = 0xcbf29ce484222325;
  auto add = [&](const void* bytes, size_t size) {
    for (size_t i = 0; i < size; ++i) hash = (hash ^ static_cast<const uint8_t*>(bytes)[i]) * 0x100000001b3;
  };
  for (const Leaf& leaf : leaves) {
    add(leaf.key, sizeof leaf.key);
    add(&leaf.log_odds, sizeof leaf.log_odds);
  }
  return hash;
}

int main(int argc, char** argv) {
  if (argc < 5) return 2;
  std::vector<Scan> scans = read_scans(argv[1]);
  double max_range = atof(argv[3]) > 0 ? atof(argv[3]) : -1;
  std::string mode = argv[4];
  bool discretize = mode != "plain", lazy = mode == "best";
  size_t before = mallinfo2().uordblks;
  octomap::OcTree tree(atof(argv[2]));
  std::vector<double> seconds;
  for (const Scan& scan : scans) {
    double start = cpu_seconds();
    tree.insertPointCloud(scan.points, scan.origin, max_range, lazy, discretize);
    seconds.push_back(cpu_seconds() - start);
  }
  if (lazy) {
    double start = cpu_seconds();
    tree.updateInnerOccupancy();
    tree.prune();
    seconds.back() += cpu_seconds() - start;
  }
  for (double s : seconds) printf("%.1f\n", s * 1e6);
  printf("heap %zu\n", mallinfo2().uordblks - before);
  std::vector<Leaf> leaves = leaves_of(tree);
  printf("leaves %016llx\n", static_cast<unsigned long long>(checksum(leaves)));
  if (argc > 5) {
    FILE* file = fopen(argv[5], "wb");
    for (const Leaf& leaf : leaves) {
      fwrite(leaf.key, sizeof leaf.key, 1, file);
      fwrite(&leaf.log_odds, sizeof leaf.log_odds, 1, file);
    }
    fclose(file);
  }
}
