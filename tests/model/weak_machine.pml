/* A machine with a weak memory order, for weak_ring.pml, weak_cells.pml and weak_doorbell.pml (check.sh).
 *
 * Each thread has a window of operations that it has issued and that the memory has not seen yet: its store buffer and its
 * pending loads in one, in program order. The window's operations reach the one shared memory in any order that AArch64
 * allows (Arm ARM, B2.3: other-multi-copy-atomic), so stores leave the buffer late and out of order, and loads are done
 * early, also before an earlier branch is decided. Operation i may be done before the earlier operation j, except:
 *   - i and j go to the same location. A load then takes the value of the youngest such store in the buffer (forwarding);
 *   - j is an acquire load;
 *   - i is a release store;
 *   - i is a load that is seq_cst (ldar), or the load of a read-modify-write that acquires (ldaxr), and j is a release store.
 *     Another acquire load does not wait (ldapr).
 * An atomic read-modify-write is a load-exclusive and a store-exclusive. In between nobody else writes the location, but
 * later operations of the same thread may be done, as on a machine with ldaxr and stlxr.
 *
 * A thread that needs a value waits for its load: an address or a branch that is taken for good depends on it. The system
 * calls that the protocols rely on (futex, the lock of a file) drain the window, as the kernel's barriers do.
 *
 * Not covered: values that are torn or mixed in size (all are words), other-multi-copy-atomicity given up (as on POWER),
 * loads that are not satisfied in the order of a dependency through memory, and more than WINDOW operations in flight.
 */
#ifndef WINDOW
#define WINDOW 6
#endif
#define REGISTERS 5

/* Kinds, and the order that an operation has besides. */
#define LOAD 1
#define STORE 2
#define EXCLUSIVE 3      /* the load of a read-modify-write; reserves the location */
#define CONDITIONAL 4    /* its store; ADDS: the value that was loaded + val */
#define PLAIN 0
#define ACQUIRE 1
#define RELEASE 2
#define SEQ_CST 4        /* of a load, with ACQUIRE; of a store RELEASE is all of it */

typedef Window {
  byte count;
  byte kind[WINDOW];
  byte at[WINDOW];
  byte value[WINDOW];
  byte order[WINDOW];
  byte to[WINDOW];       /* register of a load */
  byte reg[REGISTERS];
  byte waits;            /* bit r: register r has not got its value */
};
byte memory[LOCATIONS];
byte reserved[LOCATIONS];  /* thread + 1 whose read-modify-write is in between */
Window window[THREADS];
#ifndef ON_STORE
#define ON_STORE(thread, location, stored) skip
#endif

/* (Spin takes no calls in a c_expr.) */
c_decl {
  static int ready(int thread, int i);
\#define READY_0 ready(PCore->thread, 0)
\#define READY_1 ready(PCore->thread, 1)
\#define READY_2 ready(PCore->thread, 2)
\#define READY_3 ready(PCore->thread, 3)
\#define READY_4 ready(PCore->thread, 4)
\#define READY_5 ready(PCore->thread, 5)
};
c_code {
  static int is_load(int kind) { return kind == LOAD || kind == EXCLUSIVE; }
  static int waits_for_releases(int kind, int order) {
    return (kind == LOAD && (order & SEQ_CST)) || (kind == EXCLUSIVE && (order & ACQUIRE));
  }
  /* May operation i of the thread be done now? */
  static int ready(int thread, int i) {
    int j, source = -1;
    if (i >= now.window[thread].count) return 0;
    const int kind = now.window[thread].kind[i], order = now.window[thread].order[i], at = now.window[thread].at[i];
    for (j = 0; j < i; j++) {
      const int before = now.window[thread].kind[j], its_order = now.window[thread].order[j];
      if (is_load(before) && (its_order & ACQUIRE)) return 0;
      if (!is_load(kind) && (order & RELEASE)) return 0;
      if (waits_for_releases(kind, order) && !is_load(before) && (its_order & RELEASE)) return 0;
      if (now.window[thread].at[j] == at) {
        if (kind != LOAD || before != STORE) return 0;
        source = j;
      }
    }
    if (source >= 0 && !(order & SEQ_CST)) return 1;
    if (source >= 0) return 0;
    if (kind == LOAD) return 1;
    return now.reserved[at] == 0 || (kind == CONDITIONAL && now.reserved[at] == thread + 1);
  }
  static int loaded(int thread, int i) {
    int j, value = now.memory[now.window[thread].at[i]];
    for (j = 0; j < i; j++) {
      if (now.window[thread].at[j] == now.window[thread].at[i]) value = now.window[thread].value[j];
    }
    return value;
  }
}

/* Does operation i of the thread, and takes it out of the window. */
inline perform(thread, i) {
  d_step {
    if
    :: window[thread].kind[i] == LOAD || window[thread].kind[i] == EXCLUSIVE ->
      c_code { PCore->value = loaded(PCore->thread, PCore->i); };
      window[thread].reg[window[thread].to[i]] = value;
      window[thread].waits = window[thread].waits & (255 - (1 << window[thread].to[i]));
      if
      :: window[thread].kind[i] == EXCLUSIVE -> reserved[window[thread].at[i]] = thread + 1
      :: else
      fi
    :: window[thread].kind[i] == STORE ->
      ON_STORE(thread, window[thread].at[i], window[thread].value[i]);
      memory[window[thread].at[i]] = window[thread].value[i]
    :: window[thread].kind[i] == CONDITIONAL ->
      memory[window[thread].at[i]] = window[thread].value[i] + (window[thread].to[i] -> memory[window[thread].at[i]] : 0);
      reserved[window[thread].at[i]] = 0
    fi;
    value = 0;
    window[thread].count--;
    do
    :: i < window[thread].count ->
      window[thread].kind[i] = window[thread].kind[i + 1]; window[thread].at[i] = window[thread].at[i + 1];
      window[thread].value[i] = window[thread].value[i + 1]; window[thread].order[i] = window[thread].order[i + 1];
      window[thread].to[i] = window[thread].to[i + 1];
      i++
    :: else -> break
    od;
    window[thread].kind[i] = 0; window[thread].at[i] = 0; window[thread].value[i] = 0; window[thread].order[i] = 0;
    window[thread].to[i] = 0;
    i = 0
  }
}

/* The memory side of a thread. */
proctype Core(byte thread) {
  byte i = 0;
  byte value = 0;
end:
  do
  :: atomic { c_expr { READY_0 } -> i = 0; perform(thread, i) }
  :: atomic { c_expr { READY_1 } -> i = 1; perform(thread, i) }
  :: atomic { c_expr { READY_2 } -> i = 2; perform(thread, i) }
  :: atomic { c_expr { READY_3 } -> i = 3; perform(thread, i) }
  :: atomic { c_expr { READY_4 } -> i = 4; perform(thread, i) }
#if WINDOW > 5
  :: atomic { c_expr { READY_5 } -> i = 5; perform(thread, i) }
#endif
  od
}

/* What threads issue. Each takes its thread's number, `me`. */
#define OURS window[me]
#define ROOM(n) (OURS.count + (n) <= WINDOW)
inline put(its_kind, its_at, its_value, its_order, its_to) {
  OURS.kind[OURS.count] = its_kind;
  OURS.at[OURS.count] = its_at;
  OURS.value[OURS.count] = its_value;
  OURS.order[OURS.count] = its_order;
  OURS.to[OURS.count] = its_to;
  OURS.count++
}
#define WAITING(r) (OURS.waits & (1 << (r)))
inline load(location, its_order, r) {
  atomic { ROOM(1) -> d_step { put(LOAD, location, 0, its_order, r); OURS.waits = OURS.waits | (1 << (r)) } }
}
inline store(location, its_value, its_order) { atomic { ROOM(1) -> d_step { put(STORE, location, its_value, its_order, 0) } } }
/* The value that was there goes to r, the new one to the memory. */
inline exchange(location, its_value, its_order, r) {
  atomic { ROOM(2) ->
    d_step { put(EXCLUSIVE, location, 0, its_order, r); put(CONDITIONAL, location, its_value, its_order, 0);
             OURS.waits = OURS.waits | (1 << (r)) } }
}
inline add(location, its_value, its_order, r) {
  atomic { ROOM(2) ->
    d_step { put(EXCLUSIVE, location, 0, its_order, r); put(CONDITIONAL, location, its_value, its_order, 1);
             OURS.waits = OURS.waits | (1 << (r)) } }
}
#define HAVE(r) (!WAITING(r))
#define VALUE(r) (OURS.reg[r])
#define DRAINED (OURS.count == 0)
