/* The publish / read / take-over protocol of rtbus/detail/seqlock.hpp, to be checked by exhaustion (check.sh).
 *
 * One writer that may die before any of its stores and is followed by another one, and up to two readers, on a ring of
 * RING slots with two payload words each.
 *
 * Memory. All stores to the segment come from the writer, and a successor's come after its predecessor's (the kernel's
 * lock orders them), so the segment's whole history is one log of stores in program order. Nothing but the memory model
 * decides what a load returns from it:
 *   - A load of a location may return ANY store to it in the log, however old, except those that the reader is already
 *     known to be past. This is what store buffers, caches, and reordering of loads and stores by compiler or CPU can
 *     do: each location becomes visible on its own, the payload words in any order among each other.
 *   - A reader is past everything up to `seen`: an acquire load that returns a release store at log position t sets
 *     seen = t, because that store carries all that its thread did before. A relaxed load, or a relaxed store that is
 *     loaded, carries nothing.
 *   - Coherence within a read: the second look at a sequence word returns nothing older than the first.
 *   Coherence from one read call to the next is left out except through `seen`; that allows more than C++ does, so what
 *   holds here holds there.
 * This is the release/acquire fragment of C++20 (and of x86-64 and AArch64, which are stronger). Readers store nothing.
 *
 * -DSC makes every load return the latest store. It is used to check progress: a read that gives up is the writer's
 * doing, not the protocol's. (C++ promises no time in which a store becomes visible, so this cannot be asked otherwise.)
 */
#ifndef RING
#define RING 2
#endif
#ifndef SAMPLES
#define SAMPLES 4     /* the writer stops after this sample */
#endif
#ifndef CALLS
#define CALLS 2       /* read calls per reader */
#endif
#define MAX_TRIES 3   /* detail::kMaxTries */
#define DEATHS 1
#define MARGIN 1      /* max(1, capacity / 8), see RingReader */

/* Locations: 0 is `newest`; each slot has a sequence word and two payload words. */
#define NEWEST 0
#define SEQ(n)  (1 + 3 * (((n) - 1) % RING))
#define WORD0(n) (SEQ(n) + 1)
#define WORD1(n) (SEQ(n) + 2)
#define IS_WORD(l) ((l) != NEWEST && ((l) % 3) != 1)
#define IS_SEQ(l)  ((l) != NEWEST && ((l) % 3) == 1)

/* A payload word says which sample it belongs to and which writer wrote it. */
#define TAG(n, generation) (2 * (n) + (generation))

/* Which stores are release: all but the odd mark W1. */
#ifdef RELAXED_STORES
#define WORD_RELEASES 0
#else
#define WORD_RELEASES 1
#endif
#ifdef RELAXED_COMPLETION
#define COMPLETION_RELEASES 0
#else
#define COMPLETION_RELEASES 1
#endif
#define RELEASES(l, v) ((IS_WORD(l) && WORD_RELEASES) || (!IS_WORD(l) && !(IS_SEQ(l) && (v) % 2 == 1) && COMPLETION_RELEASES))

#ifdef RELAXED_LOADS
#define WORD_ACQUIRES 0
#else
#define WORD_ACQUIRES 1
#endif

#define LOG (5 * (SAMPLES + 2 * DEATHS) + 1)  /* room for the broken take-overs too */
byte log_location[LOG];
byte log_value[LOG];
byte stores = 0;                  /* log positions 1…stores are filled; position 0 stands for the zeroed segment */
byte announced = 0;               /* `newest` as it really is */
byte meant[SAMPLES + DEATHS + 1]; /* tag of the sample that was announced under each number */

inline store(l, v) {
  stores++;
  assert(stores < LOG);
  log_location[stores] = l;
  log_value[stores] = v
}

/* Loads location l into `out` for the reader with `seen`; `at` becomes the log position, and is the coherence floor. */
inline load(l, acquires, out, at) {
  t = stores;
  do
  :: t == 0 -> out = 0; break
  :: t > 0 && log_location[t] == l -> out = log_value[t]; break
  :: t > 0 && log_location[t] != l -> t--
#ifndef SC
  :: t > seen && t > at && log_location[t] == l -> t--   /* not visible yet */
#endif
  od;
  at = t;
  if
  :: acquires && t > seen && RELEASES(log_location[t], log_value[t]) -> seen = t
  :: else
  fi;
  t = 0
}

#define OR_DIE(statement) if :: atomic { statement } :: generation < DEATHS -> goto died fi

proctype Writer() {
  byte n = 1;
  byte generation = 0;
publish:
  if :: n > SAMPLES -> goto finished :: else fi;
#ifdef NEWEST_FIRST
  OR_DIE(store(NEWEST, n); announced = n; meant[n] = TAG(n, generation));
#endif
#ifndef NO_MARK
  OR_DIE(store(SEQ(n), 2 * n - 1));          /* W1 */
#endif
  OR_DIE(store(WORD0(n), TAG(n, generation))); /* W2 */
  OR_DIE(store(WORD1(n), TAG(n, generation)));
  OR_DIE(store(SEQ(n), 2 * n));              /* W3 */
#ifndef NEWEST_FIRST
  OR_DIE(store(NEWEST, n); announced = n; meant[n] = TAG(n, generation));  /* W4 */
#endif
  n++;
  goto publish;
died:
  /* The successor holds the lock: it sees `newest` as it is, and nothing else of its predecessor matters. */
  atomic {
    generation++;
#if defined(TAKEOVER_REWRITES_NEWEST)
    n = (announced > 0 -> announced : 1)
#elif defined(TAKEOVER_LEAVES_GAP)
    n = announced + 2
#elif defined(TAKEOVER_WITHOUT_LOCK)
    if :: n = announced + 1 :: announced > 0 -> n = announced fi
#else
    n = announced + 1
#endif
  };
  goto publish;
finished:
  n = 0
}

/* R2…R4 for sample n. `good`: the copy was accepted. */
inline copy(n) {
  atomic { at = 0; good = true;
#ifndef NO_FIRST_CHECK
    load(SEQ(n), 1, value, at);             /* R2 */
#ifdef PARITY_ONLY
    first = value; good = (value > 0 && value % 2 == 0);
#else
    good = (value == 2 * n);
#endif
    value = 0
#endif
  };
  if
  :: good ->
    atomic { word_at = 0; load(WORD0(n), WORD_ACQUIRES, word0, word_at); word_at = 0 };  /* R3 */
    atomic { word_at = 0; load(WORD1(n), WORD_ACQUIRES, word1, word_at); word_at = 0 };
#ifndef NO_SECOND_CHECK
    atomic { load(SEQ(n), 0, value, at);    /* R4 */
#ifdef PARITY_ONLY
      good = (value == first); first = 0;
#else
      good = (value == 2 * n);
#endif
      value = 0
    }
#endif
  :: else
  fi
}

/* What an accepted copy must be: whole, of the number asked for, and one that a writer finished and announced. */
inline check_accepted(n) {
  assert(word0 == word1);
  assert(word0 / 2 == n);
  assert(n <= announced);
  assert(word0 == meant[n]);
#ifdef WITNESS_SUCCESSOR
  assert(word0 % 2 == 0)   /* claims that nothing of a second writer is ever read: false, or the model checks nothing */
#else
  skip
#endif
}

#define READER_STATE byte seen = 0; byte t = 0; byte at = 0; byte word_at = 0; byte value = 0; byte word0 = 0; \
  byte word1 = 0; bool good = false; byte tries = 0; byte n = 0; byte stores_before = 0; byte calls = 0
#ifdef PARITY_ONLY
#define READER_EXTRA byte first = 0
#else
#define READER_EXTRA skip
#endif

#ifdef WITNESS_LAPPED   /* claims that no read ever gives up */
#define NOTE_START skip
#define CHECK_PROGRESS assert(false)
#elif defined(SC)
#define NOTE_START stores_before = stores
#define CHECK_PROGRESS assert(stores != stores_before)
#else
#define NOTE_START skip
#define CHECK_PROGRESS skip
#endif

proctype LatestReader() {
  READER_STATE;
  READER_EXTRA;
  byte last = 0;
  do
  :: calls == CALLS -> break
  :: calls < CALLS ->
    atomic { calls++; tries = 0; NOTE_START };
    do
    :: tries == MAX_TRIES -> CHECK_PROGRESS; break       /* kLapped */
    :: tries < MAX_TRIES ->
      atomic { at = 0; load(NEWEST, 1, n, at); at = 0 };  /* R1 */
      if
      :: n <= last -> break                              /* kSame */
      :: n > last ->
        copy(n);
        if
        :: atomic { good -> check_accepted(n); assert(n > last); last = n }; break  /* kFresh */
        :: !good -> tries++
        fi
      fi
    od;
    atomic { at = 0; word0 = 0; word1 = 0; good = false; n = 0; stores_before = 0 }
  od
}

#define HELD (RING - MARGIN)
#define OLDEST_SAFE(newest) ((newest) >= HELD -> (newest) - HELD + 1 : 1)

proctype NextReader() {
  READER_STATE;
  READER_EXTRA;
  byte next = 1;
  byte wanted = 0;
  do
  :: calls == CALLS -> break
  :: calls < CALLS ->
    atomic { calls++; tries = 0; wanted = next; NOTE_START };
    do
    :: tries == MAX_TRIES -> CHECK_PROGRESS; break       /* kLapped */
    :: tries < MAX_TRIES ->
      atomic { at = 0; load(NEWEST, 1, n, at); at = 0;    /* R1 */
        if :: n >= wanted + RING -> wanted = OLDEST_SAFE(n) :: else fi };
      if
      :: n < wanted -> break                             /* kSame */
      :: n >= wanted ->
        copy(wanted);
        if
        :: atomic { good -> check_accepted(wanted);
             assert(wanted >= next);                      /* in order */
             assert(wanted == next || announced >= next + RING - 1);  /* jumped only over what was being overwritten */
             next = wanted + 1 }; break                   /* kFresh */
        :: !good ->
          atomic { at = 0; load(NEWEST, 1, n, at); at = 0; n = OLDEST_SAFE(n);
            wanted = (n > wanted -> n : wanted + 1); tries++ }
        fi
      fi
    od;
    atomic { at = 0; word0 = 0; word1 = 0; good = false; n = 0; wanted = 0; stores_before = 0 }
  od
}

init {
  atomic {
    run Writer();
#ifdef LATEST
    run LatestReader();
#endif
#ifdef NEXT
    run NextReader();
#endif
  }
}
