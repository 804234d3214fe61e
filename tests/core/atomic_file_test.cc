#include "semblance/core/atomic_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::ptrdiff_t file_count(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

TEST(AtomicFile, AppearsOnCommitOnly) {
  const testing::TemporaryFolder folder;
  const fs::path path = folder.path() / "track.csv";
  {
    AtomicFile file(path);
    file.stream() << "one\n";
    EXPECT_FALSE(fs::exists(path));
    EXPECT_EQ(file.temporary_path().parent_path(), folder.path());
    EXPECT_EQ(file.temporary_path().extension(), ".csv");
    file.commit();
    EXPECT_EQ(content(path), "one\n");
  }
  EXPECT_EQ(content(path), "one\n");
  EXPECT_EQ(file_count(folder.path()), 1);
}

TEST(AtomicFile, AbandonedLeavesTheOldFileAndNoTrace) {
  const testing::TemporaryFolder folder;
  const fs::path path = folder.path() / "track.csv";
  std::ofstream(path) << "old";
  {
    AtomicFile file(path);
    file.stream() << "new";
  }
  EXPECT_EQ(content(path), "old");
  EXPECT_EQ(file_count(folder.path()), 1);
}

TEST(AtomicFile, TakesWhatAnotherWriterPutUnderTheTemporaryName) {
  const testing::TemporaryFolder folder;
  const fs::path path = folder.path() / "overlay.mp4";
  AtomicFile file(path);
  std::ofstream(file.temporary_path()) << "encoded elsewhere";
  file.commit();
  EXPECT_EQ(content(path), "encoded elsewhere");
}

TEST(AtomicFile, TwoWritersOfOneFileDoNotMeet) {
  const testing::TemporaryFolder folder;
  AtomicFile first(folder.path() / "a"), second(folder.path() / "a");
  EXPECT_NE(first.temporary_path(), second.temporary_path());
}

TEST(AtomicFile, RefusalsNameThePathAndTheReason) {
  const testing::TemporaryFolder folder;
  const fs::path missing = folder.path() / "nowhere" / "track.csv";
  EXPECT_THAT([&] { AtomicFile file(missing); },
              ThrowsMessage<IoError>(
                  AllOf(HasSubstr(missing.string()), HasSubstr("No such file or directory"))));
  EXPECT_THAT([&] { AtomicFile file(folder.path()); },
              ThrowsMessage<IoError>(HasSubstr("not a regular file")));
  EXPECT_THAT([] { AtomicFile file("/dev/null"); },
              ThrowsMessage<IoError>(HasSubstr("not a regular file")));
  EXPECT_THAT([&] { AtomicFile file(folder.path() / ""); },
              ThrowsMessage<IoError>(HasSubstr("name")));
}

TEST(AtomicFile, CommitReportsAStreamThatFailed) {
  const testing::TemporaryFolder folder;
  const fs::path path = folder.path() / "track.csv";
  AtomicFile file(path);
  file.stream().setstate(std::ios::failbit);
  EXPECT_THROW(file.commit(), IoError);
  EXPECT_FALSE(fs::exists(path));
}

TEST(AtomicFile, CommitReportsATemporaryFileThatIsGone) {
  const testing::TemporaryFolder folder;
  AtomicFile file(folder.path() / "track.csv");
  fs::remove(file.temporary_path());
  EXPECT_THROW(file.commit(), IoError);
}

}  // namespace
}  // namespace semblance
