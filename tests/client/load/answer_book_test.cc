#include "client/load/answer_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace deform {
namespace {

using Known = AnswerBook::Known;
using testing::ElementsAre;

TEST(AnswerBook, KnowsWhatAnEditorWasTold) {
  AnswerBook book(1);
  std::vector<uint64_t> sequences;
  EXPECT_EQ(book.Find(1, sequences), Known::kNotYet);
  book.Note(0, 1, 1);
  book.Note(0, 3, 7);
  EXPECT_EQ(book.Find(3, sequences), Known::kYes);
  EXPECT_THAT(sequences, ElementsAre(7));
  EXPECT_EQ(book.Find(4, sequences), Known::kNotYet);
}

TEST(AnswerBook, WaitsForAllEditors) {
  AnswerBook book(2);
  std::vector<uint64_t> sequences;
  book.Note(0, 5, 2);
  EXPECT_EQ(book.Find(5, sequences), Known::kNotYet);
  book.Note(1, 4, 3);
  EXPECT_EQ(book.Find(5, sequences), Known::kNotYet);
  book.Note(1, 5, 4);
  EXPECT_EQ(book.Find(5, sequences), Known::kYes);
  EXPECT_THAT(sequences, ElementsAre(2, 4));
}

TEST(AnswerBook, DoesNotGuessWhatASkippedRevisionHeld) {
  AnswerBook book(2);
  std::vector<uint64_t> sequences;
  book.Note(0, 5, 2);
  book.Note(1, 4, 3);
  book.Note(1, 6, 4);  // Pose 4 came with 5 or with 6.
  EXPECT_EQ(book.Find(5, sequences), Known::kNever);
}

TEST(AnswerBook, KnowsASkippedRevisionIfThePoseIsTheSameAround) {
  AnswerBook book(2);
  std::vector<uint64_t> sequences;
  book.Note(0, 5, 2);
  book.Note(1, 4, 3);
  book.Note(1, 6, 3);
  EXPECT_EQ(book.Find(5, sequences), Known::kYes);
  EXPECT_THAT(sequences, ElementsAre(2, 3));
}

TEST(AnswerBook, DoesNotKnowWhatWasBeforeAnEditorCame) {
  AnswerBook book(1);
  std::vector<uint64_t> sequences;
  book.Note(0, 5, 0);
  EXPECT_EQ(book.Find(4, sequences), Known::kNever);
}

TEST(AnswerBook, ForgetsWhatIsLongAgo) {
  AnswerBook book(1);
  std::vector<uint64_t> sequences;
  for (uint64_t r = 1; r <= 1000; ++r) book.Note(0, r, r);
  EXPECT_EQ(book.Find(1, sequences), Known::kNever);
  EXPECT_EQ(book.Find(990, sequences), Known::kYes);
  EXPECT_THAT(sequences, ElementsAre(990));
}

}  // namespace
}  // namespace deform
