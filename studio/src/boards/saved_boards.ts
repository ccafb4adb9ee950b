import { readBoards, type Board } from '../model/boards';
import { Saved } from '../saved';

export const savedBoards = new Saved<Board[]>('servodrome.boards', [], readBoards);

// Replaces the dashboard of that name; null removes it.
export function setBoard(name: string, to: Board | null) {
  savedBoards.set(savedBoards.get().flatMap((each) => (each.name !== name ? [each] : to ? [to] : [])));
}
