// What malloc() does with memory that was freed.
#pragma once

namespace deform::server {

// Blocks of megabytes, such as weights and models, go back to the system as
// soon as they are freed; smaller ones, such as the chunks of frames, are used
// again. Without this malloc() keeps ever larger ones. Once, before they come.
void ReturnLargeBlocks();

// Gives back what lies free between smaller blocks. Milliseconds: for when much
// was freed, and not on the threads that deform.
void ReturnFreedMemory();

}  // namespace deform::server
